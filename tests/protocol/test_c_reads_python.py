"""The C parser fed with frames that public libraries wrote, whole and damaged."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.protocol import framing_reference as reference
from tests.protocol.framing_reference import Parse

U8, U16, U32 = st.integers(0, 2**8 - 1), st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
ENCODER = st.integers(-(2**31), 2**31 - 1)
SAMPLE = st.fixed_dictionaries({"ax": U16, "ay": U16, "flags": U8, "enc1": ENCODER, "enc2": ENCODER})


def sample_record(index: int, sample: dict[str, int]) -> bytes:
    enc1, enc2 = sample["enc1"] % 2**32, sample["enc2"] % 2**32
    accel = reference.pack(
        "ACCEL", ax=sample["ax"], ay=sample["ay"], index_low16=index % 2**16, flags=sample["flags"],
        enc1_high4=enc1 >> 28, enc2_high4=enc2 >> 28,
    )  # fmt: skip
    return accel + reference.pack(
        "ENCODER", enc1_low28=enc1 % 2**28, enc2_low28=enc2 % 2**28, index_low8=index % 2**8
    )


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    samples=st.lists(SAMPLE, min_size=1, max_size=10),
    first_index=U32, t0_us=st.integers(0, 2**64 - 1), boot_id=U16, frame_seq=U16, flags=U8,
)  # fmt: skip
def test_samples_arrive_as_sent(
    c_parse: Parse, samples, first_index, t0_us, boot_id, frame_seq, flags
) -> None:
    header = {"boot_id": boot_id, "frame_seq": frame_seq, "flags": flags}
    payload = b"".join(sample_record(first_index + i, s) for i, s in enumerate(samples))
    wire = reference.encode(
        payload, kind=1, count=len(samples), first_index=first_index, t0_us=t0_us, **header
    )
    seen = c_parse(wire)
    assert (len(seen["frames"]), seen["damaged"], seen["foreign"]) == (1, 0, 0)
    (frame,) = seen["frames"]
    assert frame["records"] == samples
    expected = header | {"kind": 1, "version": 1, "first_index": first_index, "t0_us": t0_us}
    assert {name: frame[name] for name in expected} == expected


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=st.binary(max_size=400), payload=st.binary(min_size=8, max_size=8))
def test_frame_after_any_noise_is_found(c_parse: Parse, noise: bytes, payload: bytes) -> None:
    wire = reference.encode(payload, kind=16, count=1)
    seen = c_parse(noise + b"\0" + wire)
    assert [frame["records"] for frame in seen["frames"]] == [[payload.hex()]]
    assert seen["damaged"] + seen["foreign"] == sum(len(chunk) > 0 for chunk in noise.split(b"\0"))


@pytest.mark.parametrize(
    "change", [{"version": 2}, {"kind": 5}, {"kind": 0}, {"count": 2}, {"count": 0}], ids=str
)
def test_what_does_not_exist_here_is_foreign(c_parse: Parse, change: dict[str, int]) -> None:
    header = {"kind": 16, "count": 1} | change
    seen = c_parse(reference.encode(bytes(8), **header))
    assert (seen["frames"], seen["damaged"], seen["foreign"]) == ([], 0, 1)
