"""Laws of `explain --ablate`: forced effects change nothing, what a scene has changes it, a wrong plan is found out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import Shell

from symrender_cg import Camera, Gradient, Phong, Plane, PointLight, Scene, Sphere, render_image
from symrender_cg.cli.timing import interleaved_medians
from symrender_cg.errors import AccuracyError
from symrender_cg.explain import ablation
from symrender_cg.explain.ablation import Experiment, Trial, difference
from symrender_cg.explain.removals import REMOVALS, without
from symrender_cg.pipeline import draw
from symrender_cg.plan.effects import EFFECTS
from symrender_cg.run.drawing import Drawing

SMALL = ("--size", "40x30")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture(autouse=True)
def few_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ablation, "ROUNDS", 1)


@pytest.mark.parametrize("scene", ["two_spheres", "chapter1"])
def test_what_is_left_out_changes_no_pixel_and_what_is_kept_does(shell: Shell, scene: str) -> None:
    answer = shell("explain", scene, "--ablate", *SMALL, "--json")
    assert answer.code == 0
    data = json.loads(answer.out)
    assert data["holds"] is True
    tried = [trial for trial in data["trials"] if trial["change"] is not None]
    assert len(tried) >= 5
    for trial in tried:
        assert trial["ratio"] > 0.0
        if trial["status"] != "needed":
            assert trial["tried"] == "forced in"
            exact = trial["effect"] not in ablation.OTHER_FORMULAS
            assert trial["change"] <= trial["allowed"]
            assert not exact or trial["change"] == trial["allowed"] == 0.0
    kept = {trial["effect"]: trial for trial in tried if trial["status"] == "needed"}
    assert kept["diffuse"]["change"] > 0.1
    assert 0.0 < kept["diffuse"]["share"] < 1.0


def test_what_an_effect_changes_is_the_difference_of_the_two_images() -> None:
    scene = Scene.builtin("shadow").in_camera_frame()
    (trial,) = Experiment(scene, "double", size=(40, 30), effects={"shadow"}).run().trials
    lit = replace_scene(scene, shadows=False)
    apart = np.abs(render_image(scene, 40, 30, clip=False) - render_image(lit, 40, 30, clip=False))
    assert trial.tried == "shadows = false"
    assert (trial.change, trial.share) == (apart.max(), np.count_nonzero(apart) / apart.size)
    assert trial.change > 0.1


def replace_scene(scene: Scene, **changes: object) -> Scene:
    from msgspec import structs

    return structs.replace(scene, **changes)


def test_text_has_a_row_for_every_effect_of_the_plan(shell: Shell) -> None:
    answer = shell("explain", "two_spheres", "--ablate", *SMALL)
    assert answer.code == 0
    rows = [line.split() for line in answer.out.splitlines()]
    for effect in EFFECTS:
        assert sum(len(row) > 1 and row[0] in ("in", "out") and row[1] == effect.name for row in rows) == 1
    assert "BROKEN" not in answer.out
    assert "ns a pixel" in answer.out


def test_a_plan_that_leaves_out_too_much_is_found_out_with_exit_code_4(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = ablation._image

    def spoiled(drawing: Drawing, width: int, height: int) -> np.ndarray:
        image = honest(drawing, width, height)
        if "order" in drawing.plan.force:
            image[3, 5] += 2.0**-40
        return image

    monkeypatch.setattr(ablation, "_image", spoiled)
    answer = shell("explain", "two_spheres", "--ablate", *SMALL)
    assert answer.code == 4
    assert "BROKEN" in answer.out
    assert "order: left out as absent, but forced in it changes a pixel by 9.09e-13, allowed 0" in answer.err


def test_a_tolerance_allows_its_bound_and_no_more() -> None:
    scene = Scene.builtin("mirrors")
    effects = {"mirror_depth", "attenuation", "order"}
    found = Experiment(scene, "double", size=(24, 18), max_error=0.4, effects=effects).run()
    found.require()
    (depth,) = (trial for trial in found.trials if trial.effect == "mirror_depth")
    assert depth.status in ("bounded", "needed")
    forced = [t for t in found.trials if t.allowed is not None]
    assert all(t.change <= t.allowed for t in forced)
    assert any(t.allowed > 0.01 for t in forced)
    with pytest.raises(AccuracyError, match="allowed"):
        replace(found, trials=(replace(forced[0], change=1.0),)).require()


def test_a_scene_that_comes_down_to_one_sphere_is_compared_kind_by_kind() -> None:
    front, back = Sphere((0.0, 0.0, 0.0), 1.0), Sphere((0.0, 0.0, -3.0), 0.25)
    scene = Scene(Camera((0.0, 0.0, 4.0), half_height=2.0), (back, front), shadows=False)
    found = Experiment(scene, "double", size=(24, 18), effects={"hidden", "shadow"}).run()
    found.require()
    (hidden,) = (trial for trial in found.trials if trial.effect == "hidden")
    assert hidden.change == 0.0
    assert found.kernel == "centred_sphere_double"


RICH = Scene(
    Camera((0.0, 0.0, 4.0), half_height=2.0),
    (Sphere((0.5, 0.0, 0.0), 1.0, Phong((0.1, 0.2, 0.3), reflect=0.5, gate_specular=True)),),
    (PointLight((3.0, 4.0, 5.0), (1.0, 0.5, 0.25), (1.0, 0.5, 0.0)),),
    Gradient((0.0, 0.5, 1.0), 0.25),
    Plane(checker=Phong(0.3)),
)


@pytest.mark.parametrize("effect", sorted(REMOVALS))
def test_taking_an_effect_out_of_a_scene_leaves_a_scene_that_has_nothing_more_to_take_out(effect: str) -> None:
    found = without(RICH, effect)
    assert found is not None
    other, what = found
    assert other != RICH
    assert what
    assert without(other, effect)[0] == other
    assert other.camera == RICH.camera
    assert len(other.spheres) == 1
    assert effect != "colour" or other.channels == 1


def test_how_spheres_lie_is_no_matter_of_choice() -> None:
    assert {entry.name for entry in EFFECTS} > set(REMOVALS)
    assert all(without(RICH, name) is None for name in ("order", "front_test", "off_axis", "hidden", "clip"))


def test_differences_see_channels_shapes_and_what_is_not_finite() -> None:
    grey = np.array([[0.25, 0.5]])
    colour = np.repeat(grey[..., np.newaxis], 3, axis=-1)
    assert difference(grey, grey) == (0.0, 0.0)
    assert difference(grey, colour) == (0.0, 0.0)
    colour[0, 1, 2] = 0.75
    assert difference(grey, colour) == (0.25, 0.5)
    assert difference(colour, grey) == (0.25, 0.5)
    broken = np.array([[np.nan, 0.5]])
    assert difference(grey, broken) == (np.inf, 0.5)
    assert difference(broken, broken) == (0.0, 0.0)
    assert difference(np.array([[np.inf]]), np.array([[np.inf]])) == (0.0, 0.0)


def test_medians_are_of_every_drawing_in_turn() -> None:
    calls: list[str] = []

    class Told:
        dtype = np.dtype(np.float64)

        def __init__(self, name: str) -> None:
            self.name = name

        def shape(self, *points: int) -> tuple[int, ...]:
            return points

        def rows(self, image: np.ndarray, begin: int, end: int) -> None:
            assert (begin, end) == (0, image.shape[0])
            calls.append(self.name)

    rounds: list[int] = []
    found = interleaved_medians([Told("a"), Told("b")], (4, 3), rounds=3, done=lambda: rounds.append(len(calls)))
    assert calls == ["a", "b"] * 3
    assert rounds == [2, 4, 6]
    assert all(seconds >= 0.0 for seconds in found)
    real = draw(Scene.chapter1(), size=(8, 8))
    assert interleaved_medians([real], (8, 8), rounds=3)[0] > 0.0


def test_a_trial_without_a_drawing_holds() -> None:
    assert Trial("order", "", "absent", "a fact of geometry").holds
    assert not Trial("order", "", "absent", "forced in", change=1e-300, allowed=0.0).holds
