"""Clouds come back as written in every encoding; damage is named with its place."""

import base64
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from atom_core.errors import DatasetError, OutputError
from atom_core.io import pcd
from atom_core.io.pcd import PointCloud, read_pcd, write_pcd
from atom_core.io.pcd_header import ENCODINGS

sys.path.insert(0, str(Path(__file__).parent))
from pcd_encodings import write_encoded  # noqa: E402

# Written by PCL 1.13 (PCDWriter::writeBinaryCompressed) from x = i/4, y = -1.5, z = 2 or NaN for
# every fifth point, ring = i // 10; only the filling of the last page is left out.
BY_PCL_HEADER = b"""# .PCD v0.7 - Point Cloud Data file format
VERSION 0.7
FIELDS x y z ring
SIZE 4 4 4 2
TYPE F F F U
COUNT 1 1 1 1
WIDTH 10
HEIGHT 4
VIEWPOINT 0 0 0 1 0 0 0
POINTS 40
DATA binary_compressed
"""
BY_PCL_BODY = base64.b64decode(
    "xgAAADACAAABAABAAAGAPiAFAz8AAEAgAwCAIAMAoCADAMAgAwDgIAMEAEAAABAgAwAgIAMAMCADAEAgAwBQIAMAYCAD"
    "AHAgAwCAIAMAiCADAJAgAwCYIAMAoCADAKggAwCwIAMAuCADAMAgAwDIIAMA0CADANggAwDgIAMA6CADAPAgAwD4IAME"
    "AEEAAAQgAwAIIAMADCADABAgAwAUIAMAGCADABwgAwLAvwDglQMAfyE7QMfgAgPggxPgCQAAAeAKAQAC4AoBAAPgCgEA"
)

HEADER = """# .PCD v0.7
VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH 3
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS 3
DATA ascii
"""


def random_fields(rng, n):
    xyz = rng.normal(scale=10.0, size=(n, 3)).astype(np.float32)
    xyz[rng.random(n) < 0.2] = np.nan
    return {
        "x": xyz[:, 0],
        "y": xyz[:, 1],
        "z": xyz[:, 2],
        "i8": rng.integers(-128, 128, n).astype(np.int8),
        "ring": rng.integers(0, 2**16, n).astype(np.uint16),
        "i32": rng.integers(-(2**31), 2**31, n).astype(np.int32),
        "t": rng.integers(0, 2**63, n).astype(np.uint64) * np.uint64(2) + np.uint64(1),
        "range": rng.normal(size=n),
        "normal": rng.normal(size=(n, 3)).astype(np.float32),
    }


def assert_same_fields(actual, expected):
    assert list(actual) == list(expected)
    for name, values in expected.items():
        assert actual[name].dtype == values.dtype
        np.testing.assert_array_equal(actual[name], values)


def read_text(tmp_path, text, body=b""):
    path = tmp_path / "cloud.pcd"
    path.write_bytes(text.encode("latin-1") + body)
    return read_pcd(path)


def refusal(tmp_path, text, body=b""):
    with pytest.raises(DatasetError) as error:
        read_text(tmp_path, text, body)
    message = str(error.value)
    assert message.startswith(str(tmp_path / "cloud.pcd") + ":") and "\n" not in message
    return message[len(str(tmp_path / "cloud.pcd")) :]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("width, height", [(0, 1), (1, 1), (35, 1), (7, 5), (640, 20)])
def test_round_trip_of_every_type(tmp_path, encoding, width, height):
    fields = random_fields(np.random.default_rng(width), width * height)
    cloud = PointCloud(fields, width, height, (0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5))
    write_encoded(tmp_path / "a.pcd", cloud, encoding)
    back = read_pcd(tmp_path / "a.pcd")
    assert (back.width, back.height, back.viewpoint) == (width, height, cloud.viewpoint)
    assert_same_fields(back.fields, fields)


def test_positions_are_written_as_atom_writes_them(tmp_path):
    xyz = np.random.default_rng(3).normal(size=(20, 3))
    xyz[4] = np.nan
    xyz[5] = 0.0
    write_pcd(tmp_path / "a.pcd", xyz)
    data = (tmp_path / "a.pcd").read_bytes()
    for line in (b"FIELDS x y z\n", b"SIZE 4 4 4\n", b"WIDTH 20\nHEIGHT 1\n", b"DATA binary\n"):
        assert line in data
    assert data.endswith(xyz.astype("<f4").tobytes())
    np.testing.assert_array_equal(read_pcd(tmp_path / "a.pcd").xyz, xyz.astype(np.float32))


def test_organised_positions_are_flattened_row_by_row(tmp_path):
    xyz = np.random.default_rng(4).normal(size=(4, 6, 3)).astype(np.float32)
    write_pcd(tmp_path / "a.pcd", xyz)
    back = read_pcd(tmp_path / "a.pcd")
    assert (back.height, back.width) == (4, 6)
    np.testing.assert_array_equal(back.xyz[2 * 6 + 5], xyz[2, 5])
    write_pcd(tmp_path / "b.pcd", xyz.reshape(-1, 3), width=6)
    assert (tmp_path / "b.pcd").read_bytes() == (tmp_path / "a.pcd").read_bytes()


@pytest.mark.parametrize("padding", [b"", bytes(4096)])
def test_cloud_compressed_by_pcl(tmp_path, padding):
    (tmp_path / "a.pcd").write_bytes(BY_PCL_HEADER + BY_PCL_BODY + padding)
    cloud = read_pcd(tmp_path / "a.pcd")
    i = np.arange(40)
    assert (cloud.width, cloud.height) == (10, 4)
    np.testing.assert_array_equal(cloud.fields["ring"], i // 10)
    expected = np.column_stack([i * 0.25, np.full(40, -1.5), np.where(i % 5 == 0, np.nan, 2.0)])
    np.testing.assert_array_equal(cloud.xyz, expected)


def test_padded_binary_layout(tmp_path):
    """Padding between and after the fields, several values per field, bytes after the end."""
    text = (
        "VERSION .7\nFIELDS x y z _ normal ring _\nSIZE 4 4 4 1 8 2 1\nTYPE F F F U F I U\n"
        "COUNT 1 1 1 4 2 1 6\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA binary\n"
    )
    body = b"".join(
        struct.pack("<3f4x2dh6x", i, -i, np.nan if i == 2 else 0.5, i / 3, i / 7, -i)
        for i in range(4)
    )
    cloud = read_text(tmp_path, text, body + b"rest of the page")
    assert list(cloud.fields) == ["x", "y", "z", "normal", "ring"]
    np.testing.assert_array_equal(cloud.xyz[2], [2.0, -2.0, np.nan])
    np.testing.assert_array_equal(cloud.fields["normal"][3], [1.0, 3 / 7])
    np.testing.assert_array_equal(cloud.fields["ring"], [0, -1, -2, -3])


def test_old_and_sparse_headers(tmp_path):
    text = "# comment\r\nCOLUMNS x y z\r\nSIZE 4 4 4\r\nTYPE F F F\r\nPOINTS 2\r\nDATA ascii\r\n"
    cloud = read_text(tmp_path, text, b"1 2 3\r\n\r\nnan -nan 1e-3\r\n")
    np.testing.assert_array_equal(cloud.xyz[0], [1, 2, 3])
    assert np.isnan(cloud.xyz[1, :2]).all() and cloud.viewpoint[3] == 1.0


def test_whole_numbers_of_64_bits_keep_every_digit_in_text(tmp_path):
    stamps = np.array([2**63 + 1, 2**64 - 1], dtype=np.uint64)
    write_encoded(tmp_path / "a.pcd", {"t": stamps}, "ascii")
    np.testing.assert_array_equal(read_pcd(tmp_path / "a.pcd").fields["t"], stamps)


def test_sound_text_is_read_at_once_and_as_line_by_line(tmp_path, monkeypatch):
    path = tmp_path / "a.pcd"
    write_encoded(path, random_fields(np.random.default_rng(4), 500), "ascii")
    at_once = read_pcd(path).fields
    with monkeypatch.context() as patched:
        patched.setattr(pcd, "_ascii_columns", lambda *_: None)
        assert_same_fields(read_pcd(path).fields, at_once)
    monkeypatch.setattr(pcd, "_read_ascii_by_line", None)
    assert_same_fields(read_pcd(path).fields, at_once)


def test_cloud_without_positions(tmp_path):
    write_pcd(tmp_path / "a.pcd", {"x": np.zeros(2), "y": np.zeros(2)})
    with pytest.raises(DatasetError, match=r"a\.pcd: no field 'z'.*x, y"):
        _ = read_pcd(tmp_path / "a.pcd").xyz


@pytest.mark.parametrize(
    "old, new, place, what",
    [
        ("DATA ascii", "DATA zip", ":11:", "binary_compressed"),
        ("DATA ascii\n", "", ":11:", "'1' is not a word of a PCD header"),
        ("FIELDS x y z\n", "", ": ", "'FIELDS'"),
        ("FIELDS x y z", "FIELDS x y x", ":3:", "'x' twice"),
        ("FIELDS x y z", "FIELDS", ":3:", "no field"),
        ("SIZE 4 4 4", "SIZE 4 4", ":4:", "2 entries instead of 3"),
        ("SIZE 4 4 4", "SIZE 4 4 four", ":4:", "not whole numbers"),
        ("SIZE 4 4 4", "SIZE 4 4 3", ":5:", "F of 3 bytes"),
        ("TYPE F F F", "TYPE F F", ":5:", "2 entries for 3"),
        ("TYPE F F F", "TYPE F F Q", ":5:", "'z' has type Q"),
        ("COUNT 1 1 1", "COUNT 1 0 1", ":6:", "COUNT 0"),
        ("WIDTH 3", "WIDTH -3", ":7:", "WIDTH is -3"),
        ("WIDTH 3\nHEIGHT 1", "HEIGHT 1", ": ", "2 points"),
        ("WIDTH 3", "WIDTH 4", ":10:", "4 x 1 = 4"),
        ("VIEWPOINT 0", "VIEWPOINT", ":9:", "not 7 numbers"),
        ("VERSION 0.7", "VERSIO 0.7", ":2:", "'VERSIO'"),
        ("VERSION 0.7", "VERSION \xff", ":2:", "not text"),
    ],
)
def test_damaged_headers(tmp_path, old, new, place, what):
    assert old in HEADER
    text = HEADER.replace(old, new)
    message = refusal(tmp_path, text, b"1 2 3\n4 5 6\n")
    assert message.startswith(place) and what in message


@pytest.mark.parametrize(
    "body, place, what",
    [
        (b"1 2 3\n4 5\n7 8 9\n", ":13:", "2 values instead of 3"),
        (b"1 2 3\n4 5 6 7\n7 8 9\n", ":13:", "4 values instead of 3"),
        (b"1 2 3\n4 five 6\n7 8 9\n", ":13:", "'five' is not a value of field 'y'"),
        (b"1 2 3\n4 5 6\n", ": ", "2 points, but the header says 3"),
        (b"1 2 3\n" * 4, ": ", "4 points, but the header says 3"),
        (b"1 2 3\n1 \xff 3\n1 2 3\n", ":13:", "other bytes"),
    ],
)
def test_damaged_text(tmp_path, body, place, what):
    message = refusal(tmp_path, HEADER, body)
    assert message.startswith(place) and what in message


@pytest.mark.parametrize("value", ["300", "-1", "1.5", "nan"])
def test_text_out_of_the_range_of_its_type(tmp_path, value):
    text = "FIELDS r\nSIZE 1\nTYPE U\nPOINTS 2\nDATA ascii\n"
    message = refusal(tmp_path, text, f"7\n{value}\n".encode())
    assert message.startswith(":7:") and "uint8" in message


def test_cut_off_binary_names_the_bytes_missing(tmp_path):
    text = HEADER.replace("ascii", "binary")
    assert "1 of 36 bytes" in refusal(tmp_path, text, bytes(35))
    assert "36 of 36 bytes" in refusal(tmp_path, text)


@pytest.mark.parametrize(
    "body, what",
    [
        (b"", "8 of 8 bytes"),
        (struct.pack("<II", 10, 36) + bytes(4), "6 of 18 bytes"),
        (struct.pack("<II", 2, 35) + bytes(2), "35 bytes, but 3 points of 12 bytes need 36"),
        (struct.pack("<II", 2, 36) + bytes([0x40, 0]), "before their start"),
        (struct.pack("<II", 2, 36) + bytes([0, 0]), "1 bytes instead of 36"),
    ],
)
def test_damaged_compressed_bodies(tmp_path, body, what):
    assert what in refusal(tmp_path, HEADER.replace("ascii", "binary_compressed"), body)


def test_absurd_sizes_are_refused_without_taking_the_memory(tmp_path):
    text = HEADER.replace("WIDTH 3", f"WIDTH {10**15}").replace("POINTS 3", f"POINTS {10**15}")
    for encoding in ENCODINGS:
        refusal(tmp_path, text.replace("ascii", encoding), struct.pack("<II", 2, 36) + bytes(2))


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_truncation_is_a_dataset_error(tmp_path, encoding):
    fields = random_fields(np.random.default_rng(5), 12)
    write_encoded(tmp_path / "a.pcd", fields, encoding)
    data = (tmp_path / "a.pcd").read_bytes()
    # The last character of a text file may be cut without a trace: half of the last number.
    last = len(data) - (20 if encoding == "ascii" else 1)
    for length in range(0, last, 7):
        (tmp_path / "a.pcd").write_bytes(data[:length])
        with pytest.raises(DatasetError):
            read_pcd(tmp_path / "a.pcd")


def test_other_files_are_refused(tmp_path):
    assert "not a PCD file" in refusal(tmp_path, "\x89PNG\r\n\x1a\n" + "\x00" * 500)
    assert "not a PCD file" in refusal(tmp_path, "")
    assert "no line 'DATA" in refusal(tmp_path, "FIELDS x y z\nSIZE 4 4 4\n")
    with pytest.raises(DatasetError, match=r"absent\.pcd: .*no such file"):
        read_pcd(tmp_path / "absent.pcd")


@pytest.mark.parametrize(
    "content, options",
    [
        (np.zeros((4, 2)), {}),
        (np.zeros((4, 3)), {"width": 3}),
        (np.zeros((4, 3)), {"width": 3, "height": 2}),
        ({}, {}),
        ({"x": np.zeros(3), "y": np.zeros(4)}, {}),
        ({"_": np.zeros(3)}, {}),
        ({"a b": np.zeros(3)}, {}),
        ({"x": np.zeros(3, dtype=np.float16)}, {}),
        ({"x": np.zeros((3, 0))}, {}),
    ],
)
def test_what_makes_no_cloud_is_not_written(tmp_path, content, options):
    with pytest.raises(ValueError):
        write_pcd(tmp_path / "a.pcd", content, **options)
    assert list(tmp_path.iterdir()) == []


def test_unwritable_place_is_an_output_error(tmp_path):
    with pytest.raises(OutputError):
        write_pcd(tmp_path / "absent" / "a.pcd", np.zeros((1, 3)))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("number", [0, 7, 15, 22])
def test_real_ouster_clouds(real_data, tmp_path, number):
    cloud = read_pcd(real_data("ouster_board") / f"pointcloud{number}.pcd")
    assert (cloud.width, cloud.height) == (1024, 64)
    assert list(cloud.fields) == ["x", "y", "z", "intensity", "ring"]
    assert cloud.fields["ring"].dtype == np.uint8 and cloud.fields["ring"].max() == 63
    ranges = np.linalg.norm(cloud.xyz, axis=1)
    assert len(cloud.xyz) == 65_536 and np.isfinite(ranges).all() and ranges.max() < 200.0
    for encoding in ENCODINGS:
        write_encoded(tmp_path / "a.pcd", cloud, encoding)
        assert_same_fields(read_pcd(tmp_path / "a.pcd").fields, cloud.fields)
