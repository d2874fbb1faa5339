"""Images come back as written; depth never wraps around; cut off files are refused."""

import struct
import zlib

import cv2
import numpy as np
import pytest

from atom_core.errors import DatasetError, OutputError
from atom_core.io.encoded_images import encoded_image_size
from atom_core.io.images import (
    MAX_DEPTH_M,
    encode_depth_png,
    quantise_depth,
    read_depth_png,
    read_image,
    write_depth_png,
    write_image,
)


def smooth_image(height=48, width=64):
    row, column = np.mgrid[:height, :width]
    return np.stack([row * 2, column * 3, row + column], axis=-1).astype(np.uint8)


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_png_keeps_every_value(tmp_path):
    image = np.random.default_rng(1).integers(0, 256, (31, 17, 3), dtype=np.uint8)
    write_image(tmp_path / "a.png", image)
    np.testing.assert_array_equal(read_image(tmp_path / "a.png", (31, 17)), image)


@pytest.mark.parametrize("ending", [".jpg", ".JPEG"])
def test_jpeg_stays_close(tmp_path, ending):
    write_image(tmp_path / f"a{ending}", smooth_image())
    difference = read_image(tmp_path / f"a{ending}").astype(int) - smooth_image()
    assert np.abs(difference).max() < 12


def test_grey_image_is_read_with_three_channels(tmp_path):
    write_image(tmp_path / "a.png", smooth_image()[..., 0])
    image = read_image(tmp_path / "a.png")
    assert image.shape == (48, 64, 3) and image.dtype == np.uint8
    np.testing.assert_array_equal(image[..., 2], smooth_image()[..., 0])


def test_orientation_note_does_not_turn_the_pixels(tmp_path):
    """A JPEG with EXIF orientation 6 (turned by 90 degrees) keeps its height and width."""
    write_image(tmp_path / "a.jpg", smooth_image())
    tiff = (
        b"II*\x00\x08\x00\x00\x00\x01\x00\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00"
        + bytes(4)
    )
    exif = b"Exif\x00\x00" + tiff
    data = (tmp_path / "a.jpg").read_bytes()
    segment = b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif
    (tmp_path / "b.jpg").write_bytes(data[:2] + segment + data[2:])
    assert cv2.imread(str(tmp_path / "b.jpg")).shape == (64, 48, 3)  # the note is understood
    assert read_image(tmp_path / "b.jpg").shape == (48, 64, 3)


@pytest.mark.parametrize(
    "image", [np.zeros((4, 4)), np.zeros((4, 4, 4), np.uint8), np.zeros((0, 4), np.uint8)]
)
def test_what_is_no_image_is_not_written(tmp_path, image):
    with pytest.raises(ValueError):
        write_image(tmp_path / "a.png", image)
    assert list(tmp_path.iterdir()) == []


def test_other_endings_and_places_are_refused(tmp_path):
    with pytest.raises(OutputError, match=r"\.jpg or \.png"):
        write_image(tmp_path / "a.bmp", smooth_image())
    with pytest.raises(OutputError, match=r"\.png"):
        write_depth_png(tmp_path / "a.jpg", np.ones((2, 2)))
    with pytest.raises(OutputError):
        write_depth_png(tmp_path / "absent" / "a.png", np.ones((2, 2)))
    assert list(tmp_path.iterdir()) == []


def test_size_is_checked_with_both_sizes_named(tmp_path):
    write_image(tmp_path / "a.png", smooth_image())
    write_depth_png(tmp_path / "d.png", np.ones((48, 64)))
    for read, name in ((read_image, "a.png"), (read_depth_png, "d.png")):
        with pytest.raises(DatasetError) as error:
            read(tmp_path / name, (64, 48))
        message = one_line(error)
        assert name in message and "64 x 48" in message and "48 x 64" in message


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "d.png"])
def test_every_truncation_is_refused(tmp_path, name):
    if name == "d.png":
        write_depth_png(tmp_path / name, np.random.default_rng(2).uniform(0.5, 6, (20, 30)))
    else:
        write_image(tmp_path / name, smooth_image())
    data = (tmp_path / name).read_bytes()
    for length in range(0, len(data), 11):
        (tmp_path / name).write_bytes(data[:length])
        with pytest.raises(DatasetError) as error:
            (read_depth_png if name == "d.png" else read_image)(tmp_path / name)
        assert name in one_line(error)


def test_damaged_png_is_found_by_its_checksum(tmp_path):
    write_depth_png(tmp_path / "d.png", np.random.default_rng(2).uniform(0.5, 6, (20, 30)))
    data = bytearray((tmp_path / "d.png").read_bytes())
    data[len(data) // 2] ^= 0x10
    (tmp_path / "d.png").write_bytes(bytes(data))
    with pytest.raises(DatasetError, match="checksum"):
        read_depth_png(tmp_path / "d.png")


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_an_image_that_says_it_is_huge_is_refused_before_it_is_decoded(tmp_path, ending):
    path = tmp_path / f"huge{ending}"
    write_image(path, smooth_image())
    assert read_image(path).shape == smooth_image().shape
    data, huge = bytearray(path.read_bytes()), 60_000
    if ending == ".png":
        struct.pack_into(">II", data, 16, huge, huge)
        struct.pack_into(">I", data, 29, zlib.crc32(data[12:29]))
    else:
        frame = data.index(b"\xff\xc0")
        struct.pack_into(">HH", data, frame + 5, huge, huge)
    assert encoded_image_size(bytes(data)) == (huge, huge)
    path.write_bytes(bytes(data))
    with pytest.raises(DatasetError, match=r"60000 x 60000 pixels; at most 200 million"):
        read_image(path)


def test_absent_and_foreign_files(tmp_path):
    (tmp_path / "a.png").write_text("no image at all")
    with pytest.raises(DatasetError, match="no image"):
        read_image(tmp_path / "a.png")
    with pytest.raises(DatasetError, match=r"absent\.png: .*no such file"):
        read_depth_png(tmp_path / "absent.png")


@pytest.mark.parametrize(
    "shape, dtype", [((5, 5, 3), np.uint8), ((5, 5), np.uint8), ((5, 5, 3), np.uint16)]
)
def test_other_images_are_no_depth(tmp_path, shape, dtype):
    cv2.imwrite(str(tmp_path / "a.png"), np.ones(shape, dtype))
    with pytest.raises(DatasetError, match="one of 16 bits"):
        read_depth_png(tmp_path / "a.png")


def test_every_stored_depth_comes_back(tmp_path):
    stored = np.arange(65_536, dtype=np.uint16).reshape(256, 256)
    cv2.imwrite(str(tmp_path / "a.png"), stored)
    depth_m = read_depth_png(tmp_path / "a.png")
    assert depth_m.dtype == np.float32 and np.isnan(depth_m[0, 0])
    assert depth_m[-1, -1] == np.float32(MAX_DEPTH_M)
    report = write_depth_png(tmp_path / "b.png", depth_m)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "b.png"), cv2.IMREAD_UNCHANGED), stored)
    assert (report.valid, report.out_of_range, report.warning) == (65_535, 0, "")


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_depth_is_rounded_to_the_nearest_unit(tmp_path, dtype):
    depth_m = np.random.default_rng(3).uniform(0.001, 6.5, (40, 50)).astype(dtype)
    write_depth_png(tmp_path / "a.png", depth_m)
    assert np.abs(read_depth_png(tmp_path / "a.png") - depth_m).max() <= 0.5e-4 + 1e-6  # float32


def test_depth_out_of_range_never_wraps_around():
    far = [6.5536, 6.6, 13.1072, 100.0, 1e30]
    depth_m = np.array(
        [[6.5535, 6.55354, 0.0001, *far], [np.nan, np.inf, -np.inf, 0, -1, 1e-5, -0.0, 2]]
    )
    stored, report = quantise_depth(depth_m)
    np.testing.assert_array_equal(stored, [[65535, 65535, 1, 0, 0, 0, 0, 0], [0] * 7 + [20_000]])
    assert (report.pixels, report.valid, report.out_of_range) == (16, 4, 5)
    assert "5 of 16" in report.warning and "6.5535 m" in report.warning


def test_encoded_bytes_are_the_file(tmp_path):
    depth_m = np.random.default_rng(4).uniform(0, 8, (9, 7))
    data, report = encode_depth_png(depth_m)
    assert write_depth_png(tmp_path / "a.png", depth_m) == report
    assert (tmp_path / "a.png").read_bytes() == data and report.out_of_range > 0


def test_depth_must_be_an_image():
    with pytest.raises(ValueError):
        quantise_depth(np.ones(4))


def test_real_picture(real_data):
    assert read_image(real_data("charuco_real") / "calib_000.png", (720, 1280)).any()
