"""What is looked at before usd-core sees a file: bytes of stages, names and sizes in archives."""

from __future__ import annotations

import io
import os
import random
import shutil
import stat
import struct
import tarfile
import time
import zipfile
from pathlib import Path

import pytest
from hostile import crate
from hypothesis import given, settings
from hypothesis import strategies as st
from other_labs import files_below

from lab3_usd.errors import StageError
from lab3_usd.grade.intake.archives import ArchiveError, _common_top, is_archive, unpack
from lab3_usd.grade.intake.guard import can_be_read, check_layer
from lab3_usd.grade.intake.staging import Source, stage_submission
from lab3_usd.grade.intake.submission_copy import (
    Limits,
    SubmissionCopy,
    TooLargeError,
    UnreachedError,
)

SMALL = Limits(
    files=20, file_size=1 << 20, total_size=3 << 20, ratio=50, folders=6, nesting=20, prims=100
)
STAGE = b'#usda 1.0\ndef Xform "World"\n{\n}\n'


def write(path: Path, data: bytes | str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def refusal(path: Path, limits: Limits = SMALL) -> str:
    with pytest.raises(StageError) as error:
        check_layer(path, limits)
    assert str(path) not in str(error.value)
    return str(error.value)


# -- the bytes of a stage


def test_text_within_the_limits_is_returned(tmp_path: Path) -> None:
    assert check_layer(write(tmp_path / "a.usda", STAGE), SMALL) == STAGE


def test_a_crate_within_the_limits_has_no_text(tmp_path: Path) -> None:
    assert check_layer(crate(tmp_path), Limits()) is None


@pytest.mark.parametrize("opening", ['def "a" {\n', "dictionary d = {\n", "(", "[1, "])
def test_deep_text_is_refused_whatever_it_is_that_nests(tmp_path: Path, opening: str) -> None:
    path = write(tmp_path / "a.usda", "#usda 1.0\n" + opening * 21)
    assert "nested more than 20" in refusal(path)


def test_text_as_deep_as_allowed_passes(tmp_path: Path) -> None:
    deep = "#usda 1.0\n" + 'def "a" {\n' * 20 + "}\n" * 20
    assert check_layer(write(tmp_path / "a.usda", deep), SMALL) == deep.encode()


@pytest.mark.parametrize(
    "harmless",
    ['string s = "' + "{" * 50 + '"', "# " + "(" * 50, 'doc = """' + "[\n" * 50 + '"""'],
)
def test_brackets_in_strings_and_comments_do_not_nest(tmp_path: Path, harmless: str) -> None:
    path = write(tmp_path / "a.usda", f"#usda 1.0\n{harmless}\n")
    assert check_layer(path, SMALL) == path.read_bytes()
    assert can_be_read(path, SMALL)


@given(st.text(alphabet="{}()[]\"'#@\\ \na", max_size=80))
@settings(max_examples=150, deadline=None)
def test_no_text_stops_the_guard(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = write(tmp_path_factory.getbasetemp() / "any.usda", f"#usda 1.0\n{text}")
    try:
        assert check_layer(path, SMALL) == path.read_bytes()
    except StageError as error:
        assert "nested" in str(error)  # noqa: PT017 - either is fine


def test_too_many_prims_are_refused(tmp_path: Path) -> None:
    text = "#usda 1.0\n" + "".join(f'def "p{index}" {{\n}}\n' for index in range(101))
    assert "more than 100 prims" in refusal(write(tmp_path / "a.usda", text))


def test_a_file_beyond_the_size_is_refused_unread(tmp_path: Path) -> None:
    path = write(tmp_path / "a.usda", STAGE)
    os.truncate(path, SMALL.file_size + 1)
    assert "larger than 1 MB" in refusal(path)


def test_links_and_pipes_are_refused_unopened(tmp_path: Path, subtests: pytest.Subtests) -> None:
    os.mkfifo(tmp_path / "pipe.usda")
    (tmp_path / "link.usda").symlink_to(write(tmp_path / "a.usda", STAGE))
    for name in ("pipe.usda", "link.usda"):
        with subtests.test(name=name):
            assert "link, pipe or device" in refusal(tmp_path / name)


def changed(path: Path, at: int, form: str, value: int) -> Path:
    data = bytearray(path.read_bytes())
    struct.pack_into(form, data, at, value)
    return write(path, bytes(data))


def sections(path: Path) -> dict[bytes, tuple[int, int]]:
    """The places of a crate file's sections, and of their entries in its table of contents."""
    data = path.read_bytes()
    (start,) = struct.unpack_from("<q", data, 16)
    found = {}
    for index in range(struct.unpack_from("<Q", data, start)[0]):
        entry = start + 8 + 32 * index
        name, place, _ = struct.unpack_from("<16sqq", data, entry)
        found[name.rstrip(b"\0")] = (entry, place)
    return found


@pytest.mark.parametrize("start", [-1, 0, 1 << 40])
def test_a_crate_whose_table_lies_elsewhere_is_damaged(tmp_path: Path, start: int) -> None:
    assert "damaged" in refusal(changed(crate(tmp_path), 16, "<q", start), Limits())


def test_a_crate_that_holds_too_much_is_refused(tmp_path: Path) -> None:
    assert "prims and properties; not opened" in refusal(crate(tmp_path), Limits(prims=1))


@pytest.mark.parametrize("name", [b"PATHS", b"SPECS", b"TOKENS"])
def test_a_crate_that_claims_to_hold_too_much_is_damaged(tmp_path: Path, name: bytes) -> None:
    path = crate(tmp_path)
    _, place = sections(path)[name]
    assert "damaged" in refusal(changed(path, place, "<Q", 1 << 40), Limits())


@pytest.mark.parametrize("offset", [16, 24])
def test_a_crate_with_a_section_outside_is_damaged(tmp_path: Path, offset: int) -> None:
    path = crate(tmp_path)
    entry, _ = sections(path)[b"PATHS"]
    assert "damaged" in refusal(changed(path, entry + offset, "<q", 1 << 40), Limits())


@given(st.integers(0, 2**32))
@settings(max_examples=60, deadline=None)
def test_no_damage_to_a_crate_stops_the_guard(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder = tmp_path_factory.getbasetemp()
    path = folder / "damaged.usd"
    if not (folder / "whole.usd").exists():
        crate(folder, "whole.usd")
    data = bytearray((folder / "whole.usd").read_bytes())
    chance = random.Random(seed)  # noqa: S311 - the same bytes for the same seed
    for _ in range(20):
        data[chance.randrange(8, len(data))] = chance.randrange(256)
    write(path, bytes(data[: chance.randrange(8, len(data))]))
    try:
        assert check_layer(path, Limits()) is None
    except StageError as error:
        assert str(folder) not in str(error)  # noqa: PT017 - either is fine


def packaged(path: Path, entries: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", method) as packed:
        for name, data in entries.items():
            packed.writestr(name, data)
    return path


def test_a_plain_package_passes(tmp_path: Path) -> None:
    entries = {"a.usda": STAGE, "b.usdc": crate(tmp_path).read_bytes(), "t.png": b"x"}
    assert check_layer(packaged(tmp_path / "a.usdz", entries), Limits()) is None


@pytest.mark.parametrize(
    ("entries", "reason"),
    [
        ({"../a.usda": STAGE}, "leads out"),
        ({"/etc/a.usda": STAGE}, "leads out"),
        ({"a\\b.usda": STAGE}, "leads out"),
        ({"a.usdz": b"PK"}, "package in a package"),
        ({"a.usda": b"#usda 1.0\n" + b"(" * 30}, "nested more than 20"),
        ({f"{index}.png": b"" for index in range(21)}, "more than 20 files"),
    ],
)
def test_a_package_that_is_more_than_it_should_be_is_refused(
    tmp_path: Path, entries: dict[str, bytes], reason: str
) -> None:
    assert reason in refusal(packaged(tmp_path / "a.usdz", entries))


def test_a_squeezed_package_is_refused(tmp_path: Path) -> None:
    path = packaged(tmp_path / "a.usdz", {"a.usda": STAGE}, zipfile.ZIP_DEFLATED)
    assert "packed" in refusal(path)


def test_a_cut_package_is_damaged(tmp_path: Path) -> None:
    path = packaged(tmp_path / "a.usdz", {"a.usda": STAGE})
    assert "damaged" in refusal(write(path, path.read_bytes()[:-30]))


# -- archives


def zipped(path: Path, entries: dict[str, bytes]) -> Path:
    return packaged(path, entries, zipfile.ZIP_DEFLATED)


def tarred(path: Path, members: list[tuple[tarfile.TarInfo, bytes]]) -> Path:
    with tarfile.open(path, "w:gz" if path.name.endswith("gz") else "w") as packed:
        for member, data in members:
            member.size = len(data)
            packed.addfile(member, io.BytesIO(data))
    return path


def plain(name: str) -> tarfile.TarInfo:
    return tarfile.TarInfo(name)


def unpacked(archive: Path, limits: Limits = SMALL) -> tuple[dict[str, bytes], list[str]]:
    """What comes out of an archive, and what is refused of it."""
    target = archive.parent / "out"
    copy = SubmissionCopy(target, limits)
    unpack(archive, "", copy)
    return files_below(target) if target.exists() else {}, [each.path for each in copy.refused]


@pytest.mark.parametrize("name", ["a.zip", "a.ZIP", "a.tar", "a.tar.gz", "a.tgz", "a.tar.xz"])
def test_archives_are_told_by_their_names(name: str) -> None:
    assert is_archive(name)


@pytest.mark.parametrize("name", ["a.usdz", "a.usda", "zip", "a.rar", "a.gz"])
def test_other_files_are_no_archives(name: str) -> None:
    assert not is_archive(name)


@pytest.mark.parametrize("ending", [".tar", ".tar.gz"])
def test_zip_and_tar_unpack_alike(tmp_path: Path, ending: str) -> None:
    entries = {"work/a.usda": STAGE, "results/a.txt": b"x"}
    zipped(tmp_path / "a.zip", entries)
    (tmp_path / "b").mkdir()
    other = tarred(
        tmp_path / "b" / f"a{ending}", [(plain(name), data) for name, data in entries.items()]
    )
    assert unpacked(tmp_path / "a.zip") == unpacked(other) == (entries, [])


VIDEO = bytes(5 << 20)  # larger than a file and a submission may be, and packed far too well
FORMS = ["folder", "zip", "stored", "tar", "tar.gz"]


def in_form(place: Path, form: str, entries: dict[str, bytes]) -> Source:
    """The same files as a folder or an archive."""
    place.mkdir(parents=True)
    if form == "folder":
        for name, data in entries.items():
            write(place / name, data)
        return Source(place)
    if form in {"zip", "stored"}:
        kind = zipfile.ZIP_DEFLATED if form == "zip" else zipfile.ZIP_STORED
        return Source(packaged(place / "a.zip", entries, kind))
    members = [(plain(name), data) for name, data in entries.items()]
    return Source(tarred(place / f"a.{form}", members))


def test_what_is_never_opened_counts_by_its_name_in_every_form(tmp_path: Path) -> None:
    entries = {"work/a.usda": STAGE, "demo.MP4": VIDEO, "shots/1.png": VIDEO, "maps/m.png": b"p"}
    found = {}
    for form in FORMS:
        target = tmp_path / form / "copy"
        source = in_form(tmp_path / form / "given", form, entries)
        done = stage_submission([source], target, SMALL)
        found[form] = (files_below(target), done.digest, done.refused)
    assert found["folder"][0] == {**entries, "demo.MP4": b"\0", "shots/1.png": b"\0"}
    assert found["folder"][2] == ()
    assert [form for form in FORMS if found[form] != found["folder"]] == []


def test_a_file_that_is_too_large_costs_itself_alone_in_every_form(
    tmp_path: Path, subtests: pytest.Subtests
) -> None:
    import random

    entries = {"work/a.usda": STAGE, "run.bag": random.Random(1).randbytes((3 << 20) + 1)}  # noqa: S311
    for form in FORMS:
        with subtests.test(form=form):
            source = in_form(tmp_path / form / "given", form, entries)
            done = stage_submission([source], tmp_path / form / "copy", SMALL)
            assert files_below(tmp_path / form / "copy") == {"work/a.usda": STAGE}
            assert [each.path for each in done.refused] == ["run.bag"]


def test_a_video_in_the_archive_of_a_class_keeps_its_name(tmp_path: Path) -> None:
    entries = {"jane/work/a.usda": STAGE, "jane/demo.mp4": VIDEO, "jane/1.png": VIDEO}
    copy = SubmissionCopy(tmp_path / "class", SMALL, archives=True)
    unpack(zipped(tmp_path / "a.zip", entries), "", copy)
    folder, refused = staged(tmp_path, Source(tmp_path / "class" / "jane"))
    assert files_below(folder) == {"work/a.usda": STAGE, "demo.mp4": b"\0", "1.png": b"\0"}
    assert refused == []


def test_a_video_and_a_folder_of_one_name_do_not_meet(tmp_path: Path) -> None:
    entries = {"a.mp4/b.txt": b"x", "a.mp4": b"v"}
    assert unpacked(zipped(tmp_path / "a.zip", entries)) == ({"a.mp4/b.txt": b"x"}, ["a.mp4"])


@pytest.mark.parametrize(
    ("names", "top"),
    [
        (["Lab3/a", "Lab3/b/c", "__MACOSX/x"], "Lab3/"),
        (["Lab3/a", "b"], ""),
        (["Lab3/a", "Lab4/a"], ""),
        (["Lab3"], ""),
        (["../a", "../b"], ""),
        (["/a"], ""),
        ([], ""),
    ],
)
def test_the_folder_around_everything(names: list[str], top: str) -> None:
    assert _common_top(names) == top


def test_an_archive_of_thousands_of_files_is_unpacked_in_seconds(tmp_path: Path) -> None:
    many = Limits()
    archive = zipped(tmp_path / "a.zip", {f"Lab3/work/{number}": b"" for number in range(2000)})
    started = time.process_time()
    found, refused = unpacked(archive, many)
    assert (len(found), refused) == (2000, [])
    assert time.process_time() - started < 20


def test_the_folder_that_holds_everything_is_left_aside(tmp_path: Path) -> None:
    archive = zipped(
        tmp_path / "a.zip", {"Lab3/work/a.usda": STAGE, "Lab3/x": b"", "__MACOSX/._x": b""}
    )
    assert unpacked(archive) == ({"work/a.usda": STAGE, "x": b""}, [])


OUTSIDE = ["../a", "a/../../b", "/etc/a", "\\a", "C:\\a", "..\\a", "a\x07b", "n" * 250]


@pytest.mark.parametrize("name", OUTSIDE)
def test_names_that_lead_out_are_not_unpacked_from_zip(tmp_path: Path, name: str) -> None:
    found, refused = unpacked(zipped(tmp_path / "a.zip", {name: b"x", "good": b"y"}))
    assert found == {"good": b"y"}
    assert len(refused) == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.zip", "out"]


@pytest.mark.parametrize("name", OUTSIDE)
def test_names_that_lead_out_are_not_unpacked_from_tar(tmp_path: Path, name: str) -> None:
    archive = tarred(tmp_path / "a.tar", [(plain(name), b"x"), (plain("good"), b"y")])
    found, refused = unpacked(archive)
    assert found == {"good": b"y"}
    assert len(refused) == 1


def test_links_and_devices_in_archives_are_refused(tmp_path: Path) -> None:
    members = []
    for kind in (tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE):
        member = plain(f"special{kind.decode()}")
        member.type, member.linkname = kind, "/etc/passwd"
        members.append((member, b""))
    found, refused = unpacked(tarred(tmp_path / "a.tar", [*members, (plain("good"), b"y")]))
    assert (found, len(refused)) == ({"good": b"y"}, 4)


def test_a_link_in_a_zip_is_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("link")
    link.create_system = 3
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr(link, "/etc/passwd")
    assert unpacked(tmp_path / "a.zip") == ({}, ["link"])


def test_a_bomb_is_refused_and_the_rest_unpacked(tmp_path: Path) -> None:
    limits = Limits(ratio=50)
    archive = zipped(tmp_path / "a.zip", {"bomb": bytes(5_000_000), "good": b"y"})
    assert unpacked(archive, limits) == ({"good": b"y"}, ["bomb"])


def test_a_tar_that_grows_too_much_is_refused_whole(tmp_path: Path) -> None:
    archive = tarred(tmp_path / "a.tar.gz", [(plain("bomb"), bytes(5_000_000))])
    with pytest.raises(TooLargeError):
        unpacked(archive, Limits(ratio=50))


def test_a_file_beyond_the_size_is_refused(tmp_path: Path) -> None:
    big = random.Random(1).randbytes(SMALL.file_size + 1)  # noqa: S311 - any bytes
    assert unpacked(zipped(tmp_path / "a.zip", {"big": big, "good": b"y"})) == (
        {"good": b"y"},
        ["big"],
    )


def test_all_files_together_have_a_limit(tmp_path: Path) -> None:
    part = random.Random(1).randbytes(1 << 20)  # noqa: S311 - any bytes
    with pytest.raises(TooLargeError, match="3 MB"):
        unpacked(zipped(tmp_path / "a.zip", {str(index): part for index in range(4)}))


@pytest.mark.parametrize("ending", [".zip", ".tar"])
def test_the_number_of_files_has_a_limit(tmp_path: Path, ending: str) -> None:
    names = [f"f{index}" for index in range(22)]
    if ending == ".zip":
        archive = zipped(tmp_path / "a.zip", dict.fromkeys(names, b""))
    else:
        archive = tarred(tmp_path / "a.tar", [(plain(name), b"") for name in names])
    with pytest.raises(TooLargeError, match="more than 20 files"):
        unpacked(archive)


def encrypted(archive: Path) -> Path:
    """The archive, whose only file says that it is encrypted."""
    data = bytearray(archive.read_bytes())
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    return write(archive, bytes(data))


def test_an_encrypted_file_is_refused(tmp_path: Path) -> None:
    assert unpacked(encrypted(zipped(tmp_path / "a.zip", {"secret": b"x"}))) == ({}, ["secret"])


def test_an_encrypted_video_counts_by_its_name(tmp_path: Path) -> None:
    assert unpacked(encrypted(zipped(tmp_path / "a.zip", {"a.mp4": b"x"}))) == (
        {"a.mp4": b"\0"},
        [],
    )


def test_a_damaged_file_is_dropped_and_named(tmp_path: Path) -> None:
    archive = packaged(tmp_path / "a.zip", {"a": b"x" * 1000, "good": b"y"})
    data = archive.read_bytes().replace(b"x" * 1000, b"x" * 999 + b"z")
    assert unpacked(write(archive, data)) == ({"good": b"y"}, ["a"])


def test_of_two_files_with_one_name_the_first_counts(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr("a", "first")
        with pytest.warns(UserWarning, match="Duplicate"):
            packed.writestr("a", "second")
    assert unpacked(tmp_path / "a.zip") == ({"a": b"first"}, ["a"])


def test_a_file_where_a_folder_is_needed_is_refused(tmp_path: Path) -> None:
    assert unpacked(zipped(tmp_path / "a.zip", {"a": b"", "a/b": b""})) == ({"a": b""}, ["a/b"])


def test_an_archive_in_an_archive_is_refused(tmp_path: Path) -> None:
    assert unpacked(zipped(tmp_path / "a.zip", {"b.zip": b"PK", "c": b""})) == (
        {"c": b""},
        ["b.zip"],
    )


@pytest.mark.parametrize("data", [b"", b"PK", b"Rar!", b"\1" * 600])
@pytest.mark.parametrize("name", ["a.zip", "a.tar.gz"])
def test_what_is_no_archive_is_said_to_be_damaged(tmp_path: Path, name: str, data: bytes) -> None:
    with pytest.raises(ArchiveError, match="pack it again"):
        unpacked(write(tmp_path / name, data))


def test_what_comes_before_the_damage_of_a_tar_is_kept(tmp_path: Path) -> None:
    archive = tarred(tmp_path / "a.tar", [(plain("good"), b"y" * 600), (plain("cut"), b"z" * 5000)])
    found, refused = unpacked(write(archive, archive.read_bytes()[:3000]))
    assert found["good"] == b"y" * 600
    assert refused


# -- staging


def staged(tmp_path: Path, *sources: Source, limits: Limits = SMALL) -> tuple[Path, list[str]]:
    target = tmp_path / "copy"
    target.mkdir()
    found = stage_submission(sources, target, limits)
    return found.folder, [each.path for each in found.refused]


def test_a_folder_is_copied_as_it_is(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/notes.txt", b"n")
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert files_below(folder) == {"work/a.usda": STAGE, "notes.txt": b"n"}
    assert refused == []


def test_the_submission_is_found_below_other_folders(tmp_path: Path) -> None:
    write(tmp_path / "jane/RAS545/Lab3/work/a.usda", STAGE)
    folder, _ = staged(tmp_path, Source(tmp_path / "jane"))
    assert files_below(folder) == {"work/a.usda": STAGE}


def test_leftovers_are_not_copied(tmp_path: Path) -> None:
    for name in (".DS_Store", ".git/config", "__MACOSX/a", "work/.thumbs/a.png", "Thumbs.db"):
        write(tmp_path / "jane" / name, b"x")
    write(tmp_path / "jane/work/a.usda", STAGE)
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert (list(files_below(folder)), refused) == (["work/a.usda"], [".git"])


def test_a_link_inside_is_followed_and_one_that_leads_out_is_not(tmp_path: Path) -> None:
    work = tmp_path / "jane/work"
    write(work / "a.usda", STAGE)
    write(tmp_path / "secret", b"s")
    (work / "inside.usda").symlink_to("a.usda")
    (work / "outside.usda").symlink_to(tmp_path / "secret")
    (work / "circle.usda").symlink_to("circle.usda")
    (tmp_path / "jane" / "folder").symlink_to(tmp_path)
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert files_below(folder) == {"work/a.usda": STAGE, "work/inside.usda": STAGE}
    assert refused == ["folder", "work/circle.usda", "work/outside.usda"]


def test_pipes_are_refused_unopened(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    os.mkfifo(tmp_path / "jane/work/pipe.usda")
    assert staged(tmp_path, Source(tmp_path / "jane"))[1] == ["work/pipe.usda"]


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads every file")
def test_a_file_without_permission_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE).chmod(0)
    write(tmp_path / "jane/work/b.usda", STAGE)
    with pytest.raises(UnreachedError, match=r"work/a\.usda: cannot be read"):
        staged(tmp_path, Source(tmp_path / "jane"))


def test_an_archive_at_the_top_of_a_folder_is_unpacked(tmp_path: Path) -> None:
    (tmp_path / "jane").mkdir()
    zipped(tmp_path / "jane/all.zip", {"Lab3/work/a.usda": STAGE})
    write(tmp_path / "jane/report.txt", b"r")
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert files_below(folder) == {"work/a.usda": STAGE, "report.txt": b"r"}
    assert refused == []


def test_a_damaged_archive_beside_stages_costs_only_itself(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/more.zip", b"no")
    write(tmp_path / "jane/more.rar", b"Rar!")
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert (list(files_below(folder)), refused) == (["work/a.usda"], ["more.rar", "more.zip"])


def test_single_files_come_under_the_names_they_are_given(tmp_path: Path) -> None:
    first = write(tmp_path / "jane_1_2_a.usda", STAGE)
    folder, _ = staged(tmp_path, Source(first, "a.usda"), Source(first, "b.usda"))
    assert files_below(folder) == {"a.usda": STAGE, "b.usda": STAGE}


def test_videos_and_pictures_count_by_their_names(tmp_path: Path) -> None:
    for name in ("demo.mp4", "maps/photo.png"):
        os.truncate(write(tmp_path / "jane" / name, b"x"), 50_000_000)
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/maps/map.png", b"small")
    folder, refused = staged(tmp_path, Source(tmp_path / "jane"))
    assert refused == []
    assert files_below(folder) == {
        "demo.mp4": b"\0",
        "maps/map.png": b"small",
        "maps/photo.png": b"\0",
        "work/a.usda": STAGE,
    }


@pytest.mark.parametrize("text", ["[" * 100, "{" * 61 + "}" * 61, "b: [" + "*a, " * 60 + "]"])
def test_yaml_that_unfolds_is_refused(tmp_path: Path, text: str) -> None:
    write(tmp_path / "jane/maps/map.yaml", f"a: &a 1\n{text}")
    assert staged(tmp_path, Source(tmp_path / "jane"))[1] == ["maps/map.yaml"]


def test_plain_yaml_is_copied(tmp_path: Path) -> None:
    text = b"image: map.pgm\norigin: [-6.2, -3.32, 0]\nnote: a * b\n"
    write(tmp_path / "jane/map.yaml", text)
    assert files_below(staged(tmp_path, Source(tmp_path / "jane"))[0]) == {"map.yaml": text}


def digest_of(folder: Path) -> str:
    target = folder.parent / "copy"
    target.mkdir()
    try:
        return stage_submission([Source(folder)], target, SMALL).digest
    finally:
        shutil.rmtree(target)


def test_the_digest_tells_contents_and_names_apart(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    first = digest_of(tmp_path / "jane")
    assert digest_of((tmp_path / "jane").rename(tmp_path / "moved")) == first
    write(tmp_path / "moved/work/a.usda", STAGE + b"\n")
    second = digest_of(tmp_path / "moved")
    (tmp_path / "moved/work/a.usda").rename(tmp_path / "moved/work/b.usda")
    third = digest_of(tmp_path / "moved")
    (tmp_path / "moved/link").symlink_to("/etc/passwd")
    assert len({first, second, third, digest_of(tmp_path / "moved")}) == 4


def test_files_of_no_kind_in_a_package_are_left_to_usd_core(tmp_path: Path) -> None:
    assert check_layer(packaged(tmp_path / "a.usdz", {"a.usda": b"?", "b.txt": b""}), SMALL) is None


def test_brackets_that_close_do_not_count(tmp_path: Path) -> None:
    text = "#usda 1.0\n" + '"["' * 30 + "[{(" * 5 + ")}]" * 5
    assert check_layer(write(tmp_path / "a.usda", text), SMALL) == text.encode()


def test_a_name_that_is_no_unicode_is_refused(tmp_path: Path) -> None:
    copy = SubmissionCopy(tmp_path, SMALL)
    assert copy.place("work/a\udcff.usda") is None
    assert [each.path for each in copy.refused] == ["work/a\\udcff.usda"]


def test_files_too_many_folders_deep_are_refused(tmp_path: Path) -> None:
    assert unpacked(zipped(tmp_path / "a.zip", {"top": b"", "d/" * 6 + "x": b"x"})) == (
        {"top": b""},
        ["d/" * 6 + "x"],
    )


def test_folders_too_deep_are_not_walked(tmp_path: Path) -> None:
    write(tmp_path / "jane" / ("d/" * 8 + "x"), b"x")
    write(tmp_path / "jane" / "work" / "a.usda", STAGE)
    assert staged(tmp_path, Source(tmp_path / "jane"))[1] == ["d/d/d/d/d/d/d"]


def test_a_picture_whose_name_is_taken_is_not_written_twice(tmp_path: Path) -> None:
    copy = SubmissionCopy(tmp_path, SMALL)
    for _ in range(2):
        copy.take("a.mp4", 5, io.BytesIO(b"video"))
    copy.take(".hidden.mp4", 5, io.BytesIO(b"video"))
    assert files_below(tmp_path) == {"a.mp4": b"\0"}


def test_a_file_that_went_well_is_not_forgotten(tmp_path: Path) -> None:
    copy = SubmissionCopy(tmp_path, SMALL)
    copy.take("a", 1, io.BytesIO(b"x"))
    copy.forget("a", "damaged")
    assert (files_below(tmp_path), copy.refused) == ({"a": b"x"}, [])


def test_a_file_shorter_than_it_says_ends_where_it_ends(tmp_path: Path) -> None:
    SubmissionCopy(tmp_path, SMALL).take("a", 100, io.BytesIO(b"x"))
    assert files_below(tmp_path) == {"a": b"x"}


def test_a_pipe_called_zip_is_not_waited_for(tmp_path: Path) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    os.mkfifo(tmp_path / "jane/pipe.zip")
    assert staged(tmp_path, Source(tmp_path / "jane"))[1] == ["pipe.zip"]


def test_a_file_that_this_computer_may_not_open_is_not_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "jane/work/a.usda", STAGE)
    write(tmp_path / "jane/work/b.usda", STAGE)
    real = os.open

    def refuse(path: object, *arguments: int) -> int:
        if str(path).endswith("a.usda"):
            raise PermissionError(13, "Permission denied")
        return real(path, *arguments)  # type: ignore[call-overload]  # as it was called

    monkeypatch.setattr("lab3_usd.grade.intake.staging.os.open", refuse)
    with pytest.raises(UnreachedError, match=r"work/a\.usda: cannot be read"):
        staged(tmp_path, Source(tmp_path / "jane"))
