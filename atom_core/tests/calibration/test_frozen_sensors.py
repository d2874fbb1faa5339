"""A sensor that hung, and sent old data again with new stamps, is named; nobody else is."""

import pytest

from atom_core.calibration.calibrate import calibrate
from atom_core.calibration.preflight import preflight
from atom_core.report.calibration_results import calibration_results
from atom_core.report.calibration_verdict import calibration_verdict
from atom_core.report.check_verdict import check_verdict
from atom_core.report.verdict import WEAK, WRONG
from atom_core.synthetic import Noise, scenes
from atom_core.synthetic.mistakes import Origin, with_detections_from


@pytest.fixture(scope="module")
def scene():
    return scenes.random_scene(3, rgb=2, depth=1, lidar3d=1, collections=10)


def frozen(dataset, sensor, since, until):
    """Return the dataset in which a sensor saw, in some collections, what it saw in the first."""
    keys = [key for key, _ in dataset.detections() if key.sensor == sensor]
    keys = [key.collection for key in keys][since:until]
    origins = {(key, sensor): Origin(dataset, keys[0]) for key in keys[1:]}
    return with_detections_from(dataset, origins), keys


@pytest.mark.parametrize("sensor", ["rgb_1", "depth_1", "lidar_1"])
def test_it_is_named_with_its_collections_before_and_after(scene, sensor):
    hung, keys = frozen(scene.dataset, sensor, 2, 5)
    told = f"sensor '{sensor}': its labels are the same to the last digit in collections "
    result = preflight(hung)
    (warning,) = [w for w in result.warnings if "the same to the last digit" in w]
    assert warning.startswith(told + ", ".join(keys))
    verdict = check_verdict(hung, result)
    assert verdict.sensors[sensor].grade == verdict.grade == WEAK
    calibration = calibrate(hung)
    assert warning in calibration.warnings
    verdict = calibration_verdict(calibration_results(calibration, "any"))
    assert verdict.sensors[sensor].grade == verdict.grade == WRONG
    assert "it sent old data again" in verdict.sensors[sensor].sentence.split("; ")[0]
    assert f"likely cause ({sensor}): its labels are the same" in verdict.sentence


@pytest.mark.parametrize("sensor", ["depth_1", "lidar_1"])
def test_also_where_nothing_else_tells_it(scene, sensor):
    """One label among ten that does not fit is left out as any bad label."""
    verdict = calibration_verdict(
        calibration_results(calibrate(frozen(scene.dataset, sensor, 2, 4)[0]), "any")
    )
    assert verdict.sensors[sensor].grade == verdict.grade == WEAK
    assert "it sent old data again" in verdict.sensors[sensor].sentence


@pytest.mark.parametrize(
    "make",
    [
        lambda: scenes.random_scene(3, noise=Noise.none()),
        lambda: scenes.hand_eye(1, collections=6, noise=Noise.none()),
        lambda: scenes.hand_eye(1, collections=6),
    ],
)
def test_what_moved_is_not(make):
    assert not preflight(make().dataset).caveats


def test_who_stands_still_before_a_board_that_stays_is_not():
    """Without noise, as in simulations: the others see the board elsewhere since they move."""
    dataset = scenes.random_scene(3, rgb=2, depth=0, lidar3d=0, noise=Noise.none()).dataset
    still, keys = frozen(dataset, "rgb_1", 0, 3)
    edge = still.sensors["rgb_2"].edge
    for number, key in enumerate(keys):
        moved = still.collections[key].transforms[edge].copy()
        moved[:3, 3] += 0.1 * number
        still = still.with_transforms({key: {edge: moved}})
    assert not preflight(still).caveats
