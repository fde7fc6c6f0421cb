"""Files of other targets on disk: written again and compared, and nothing touched that is not modelgen's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from modelgen.errors import ModelgenError, RenderError
from modelgen.render.target import target_files
from modelgen.render.target_writer import check_target, refuse_shared_files, write_target
from modelgen.spec.load import catalog_path, load_spec

SPEC = load_spec(catalog_path("emps300"))
SETS = ["qm_qc", "qm_ac"]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("target", ["numpy", "matlab", "c"])
def test_what_is_written_is_up_to_date_and_written_again(tmp_path: Path, target: str) -> None:
    folder = tmp_path / "deep" / "out"
    assert {drift.state for drift in check_target(SPEC, SETS, folder, target, None)} == {"missing"}
    written = write_target(SPEC, SETS, folder, target, None)
    assert sorted(path.name for path in written) == names(folder)
    assert check_target(SPEC, SETS, folder, target, None) == []
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert sorted(write_target(SPEC, SETS, folder, target, None)) == sorted(written)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("target", ["matlab", "c"])
def test_every_file_of_every_sensor_set_is_there(tmp_path: Path, target: str) -> None:
    write_target(SPEC, SETS, tmp_path, target, None)
    expected = {name: text for chosen in SETS for name, text in target_files(SPEC, chosen, target).items()}
    assert names(tmp_path) == sorted(expected)
    assert all((tmp_path / name).read_text(encoding="utf-8") == text for name, text in expected.items())


def test_files_that_would_replace_one_another_are_refused() -> None:
    again = replace(SPEC, sha256="0" * 64)
    capitals = replace(SPEC, name="EMPS300")
    refuse_shared_files([(SPEC, SETS), (SPEC, SETS)])  # the same twice
    for other in (again, capitals):
        with pytest.raises(
            RenderError, match=f"the files of {other.name}_qm_qc would replace those of emps300_qm_qc"
        ):
            refuse_shared_files([(SPEC, SETS), (other, ["qm_qc"])])
    with pytest.raises(RenderError, match="the files of emps300_QM_ac would replace those of emps300_qm_ac"):
        refuse_shared_files([(SPEC, [*SETS, "QM_ac"])])


def test_what_differs_and_what_is_missing_is_named(tmp_path: Path) -> None:
    first, second, *_ = write_target(SPEC, SETS, tmp_path, "c", None)
    first.write_bytes(first.read_bytes() + b"/* mine */\n")
    second.unlink()
    drifts = check_target(SPEC, SETS, tmp_path, "c", None)
    assert {(drift.path, drift.state) for drift in drifts} == {(first, "different"), (second, "missing")}
    write_target(SPEC, SETS, tmp_path, "c", None)  # its header says that modelgen wrote it
    assert check_target(SPEC, SETS, tmp_path, "c", None) == []


def test_a_foreign_file_is_spared_and_nothing_else_is_written(tmp_path: Path) -> None:
    name = sorted(target_files(SPEC, "qm_ac", "matlab"))[0]
    (tmp_path / name).write_text("my own work\n", encoding="utf-8")
    with pytest.raises(RenderError) as caught:
        write_target(SPEC, SETS, tmp_path, "matlab", None)
    assert str(caught.value) == (
        f"{tmp_path / name}: exists and was not written by modelgen; "
        "move it away or choose another folder with -o"
    )
    assert names(tmp_path) == [name]
    assert (tmp_path / name).read_text(encoding="utf-8") == "my own work\n"


def test_a_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("mine", encoding="utf-8")
    name = sorted(target_files(SPEC, "qm_ac", "c"))[0]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "target")
    with pytest.raises(ModelgenError, match="is a link"):
        write_target(SPEC, SETS, tmp_path / "out", "c", None)
    assert (tmp_path / "target").read_text(encoding="utf-8") == "mine"
    assert names(tmp_path / "out") == [name]


def test_ones_own_templates_are_written_and_compared(tmp_path: Path) -> None:
    templates, out = tmp_path / "templates", tmp_path / "out"
    templates.mkdir()
    (templates / "model.jl.j2").write_text("# {{ model.name }}\n", encoding="utf-8")
    (templates / "part.j2").write_text("never a file of its own", encoding="utf-8")
    written = write_target(SPEC, ["qm_ac"], out, "numpy", templates)
    assert [path.name for path in written] == names(out) == ["emps300_qm_ac.jl"]
    assert written[0].read_text(encoding="utf-8") == "# emps300_qm_ac\n"
    # it does not say that modelgen wrote it, but it is what would be written
    assert write_target(SPEC, ["qm_ac"], out, "numpy", templates) == written
    assert check_target(SPEC, ["qm_ac"], out, "numpy", templates) == []
    (templates / "model.jl.j2").write_text("# other\n", encoding="utf-8")
    assert [drift.state for drift in check_target(SPEC, ["qm_ac"], out, "numpy", templates)] == ["different"]
    with pytest.raises(RenderError, match="was not written by modelgen"):
        write_target(SPEC, ["qm_ac"], out, "numpy", templates)


@pytest.mark.parametrize("suffix", ["../up", "a/b", "a\\b", "a:b"])
def test_a_template_cannot_name_a_file_elsewhere(tmp_path: Path, suffix: str) -> None:
    from modelgen.render.target_writer import write_files

    with pytest.raises(ModelgenError, match="is no name of a file"):
        write_files(SPEC, ["qm_ac"], tmp_path / "out", lambda spec, chosen: {f"m.{suffix}": "text"})
    assert list(tmp_path.iterdir()) == []
