"""Command line: list, write, judge, table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from . import judge, table
from .effects import EVERY, NAMED, NAMED2
from .folder import write
from .harmless import HARMLESS
from .study import make


def _list() -> None:
    for key, kind in EVERY.items():
        name = kind.name or "-" + (f" (near {', '.join(kind.near)})" if kind.near else "")
        needs = f" [needs {', '.join(sorted(kind.needs))}]" if kind.needs else ""
        print(f"{key:26s} {name}{needs}")
    for key, quirk in HARMLESS.items():
        print(f"{key:26s} harmless: {quirk.words}")
    named = len(NAMED) + len(NAMED2)
    print(
        f"{len(EVERY)} effects, {named} with a name of the catalogue; {len(HARMLESS)} harmless kinds",
        file=sys.stderr,
    )


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m bench.independent", description=__doc__)
    sub = parser.add_subparsers(dest="command", required=True)
    sub.add_parser("list", help="all hidden effects")
    one = sub.add_parser("write", help="write one study and its truth")
    one.add_argument("--seed", type=int, required=True)
    one.add_argument("--out", type=Path, required=True)
    judge.describe(one)
    many = sub.add_parser("judge", help="write studies, run impid-host diagnose on each, judge it")
    many.add_argument("--seeds", required=True, help="FIRST:LAST, both included")
    many.add_argument("--out", type=Path, required=True, help="JSON lines; seeds already there are skipped")
    judge.describe(many)
    judge.describe_runs(many)
    page = sub.add_parser("table", help="counts by effect and strength, from judge's lines")
    page.add_argument("lines", type=Path, nargs="+")
    page.add_argument("--markdown", type=Path, help="write there instead of printing")
    return parser


def main() -> None:
    args = _arguments().parse_args()
    if args.command == "list":
        _list()
    elif args.command == "write":
        wish = judge.wanted_of(args.seed, args)
        try:
            study = make(args.seed, wish.effects, wish.unusual, args.measure, wish.harmless)
            folder = write(study, args.out)
        except FileExistsError:
            sys.exit(f"{args.out / 'study'} is there already: name another --out")
        print(folder)
    elif args.command == "judge":
        judge.run(args)
    else:
        text = table.page(args.lines)
        if args.markdown:
            args.markdown.write_text(text)
        else:
            print(text)


if __name__ == "__main__":
    main()
