"""A second simulator of laboratories, which judges ``impid-host diagnose``.

Written from the study format, the diagnosis format and physics books; it shares no code with the
other simulator of this repository nor with the host, and it meets the tool in two places only: the
study folder and the command line.

    python -m bench.independent list
    python -m bench.independent write --seed 7 --out DIR --effect cable_in_all_trials --strength 3
    python -m bench.independent judge --seeds 1:50 --out judged.jsonl
    python -m bench.independent table judged.jsonl

``--kind named2``, ``unnamed2`` and ``unusual2`` are second books, made after the first had been looked at while
the diagnosis was built: other effects without a name, other forms of those with one, other harmless noise.

How a study comes about, one file each:

- ``mechanics``    two links, absolute angles, by Lagrange; the force of a mass with springs, of an arm
- ``laboratory``   everything that a seed decides: robot, loads, instruments, noise, trials
- ``motion``       reference motions, and what a PD controller makes of them
- ``effects``      what the papers' model lacks, each a small class that acts where it acts in nature
- ``noise``        noise by its kind and its root mean square
- ``harmless``     unusual noise, steps and logging that hide nothing
- ``instruments``  sampling, clocks, converters, lost rows
- ``chain``        from a motion and the effects to what reaches the instruments
- ``residual``, ``strength``   how large an effect is beside the noise, and setting it so
- ``study``, ``declared``      a whole study, its noise floors, its truth, its setup
- ``folder``       the files
- ``rules``, ``judge``, ``table``   what counts as right, the runs, the counts

The motion is made first, and the torque follows from it by inverse dynamics, so every record obeys
its equations to rounding whatever the controller did.
"""
