"""Pack a training for another machine, one with a GPU and perhaps without a network, into one archive.

    python examples/detector/pack_training.py --config examples/detector/photographs.yaml --out photographs.tar
    tar xf photographs.tar && STEPS=10 photographs/run.sh   # there

It holds the plan, its mixture with paths that hold anywhere, the data sets, the weights to start from, standoff's wheel
and the lock of its dependencies, and `run.sh` (run_packed.sh), which installs, compares what the GPU computes with what
the CPU does, and trains. `--recipe` packs make_data.sh in place of the data sets, `--wheels` the dependencies besides.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from standoff import __version__
from standoff.core.errors import ConfigError, DataError, MissingDependency, ModelError, OutputError, StandoffError
from standoff.files.fingerprint import file_sha256
from standoff.files.json_text import plain
from standoff.files.whole import whole_file
from standoff.files.yaml_text import dump_yaml
from standoff.labels import LabelledData, read_data
from standoff.labels.documents import read_yaml, resolve_path
from standoff.labels.mixture import is_mixture, read_mixture
from standoff.labels.regions import OWN_REGIONS
from standoff.labels.splits import require_splits
from standoff.stages.detect import SHIPPED_MODELS
from standoff.training.architectures import ARCHITECTURES
from standoff.training.run.plan import make_plan, read_plan

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
RECIPE = (
    "make_data.sh", "label_people.py", "take_photographs.py",
    "backgrounds.yaml", "people.yaml", "unlabelled.yaml", "real_points.yaml",
)  # fmt: skip
BESIDE_WEIGHTS = ("network.cfg", "classes.names")
"""In the folder of a run; they say what its weights know."""
_OF_DATA = re.compile(r"^\$(DATA|\{DATA\})/")


@dataclass(slots=True)
class Pack:
    """What goes into the archive.

    Attributes:
        files: Place in the archive to the file that goes there.
        texts: Place to what is written for it.
    """

    files: dict[str, Path] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)

    def add_file(self, place: str, path: Path, what: str) -> str:
        """Add a file; return its place."""
        if not path.is_file():
            raise DataError(expected=f"{what} at {path}", found=_nothing(path), fix="check the path")
        self.files[place] = path
        return place

    def add_folder(self, place: str, folder: Path, what: str) -> str:
        """Add all that is in a folder, links as what they point to, hidden files left out; return its place."""
        if not folder.is_dir():
            raise DataError(expected=f"{what} at {folder}", found=_nothing(folder), fix="make it first, or --recipe")
        for path in _walk(folder):
            self.add_file(f"{place}/{path.relative_to(folder).as_posix()}", path, f"a file of {what}")
        return place

    def free_place(self, wanted: str) -> str:
        """Return a place in which nothing is yet, named after what is wanted."""
        taken = {Path(place).parts[1] for place in self.files if place.startswith("data/")}
        name = re.sub(r"[^\w.-]+", "_", wanted).strip(".") or "set"
        numbered = [name, *(f"{name}-{number}" for number in range(2, len(taken) + 3))]
        return "data/" + next(one for one in numbered if one not in taken)


def _nothing(path: Path) -> str:
    return "a link to nothing" if path.is_symlink() else "another kind of file" if path.exists() else "nothing"


def _walk(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder, followlinks=True):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(parent, name) for name in sorted(names) if not name.startswith("."))


def pack_mixture(data: Path, pack: Pack) -> dict[str, Any]:
    """Add the data sets that a mixture names, or the one set that is given.

    Returns:
        The mixture as it stands in the archive.
    """
    if is_mixture(data):
        read_mixture(data)  # says what is wrong with it
        content = read_yaml(data)
    else:
        content = {"sources": [{"path": str(data.resolve()), "name": data.resolve().name}]}
    return content | {"sources": [_pack_source(entry, data.parent, pack) for entry in content["sources"]]}


def _pack_source(entry: dict[str, Any], folder: Path, pack: Pack) -> dict[str, Any]:
    path = resolve_path(entry["path"], folder)
    name = entry.get("name", path.name)
    what, place = f"the data set '{name}'", pack.free_place(name)
    moved: dict[str, Any] = entry | {"name": name}
    if path.is_file() and "pictures" in entry:
        moved["path"] = pack.add_file(f"{place}/{path.name}", path, what)
        if (regions := path.with_name(OWN_REGIONS)).is_file():
            pack.add_file(f"{place}/{OWN_REGIONS}", regions, what)
    else:
        # Pictures are beside the file that describes them, or, of COCO, beside the folder that it is in.
        is_inner = path.is_file() and path.parent.name == "annotations"
        home = path.parent.parent if is_inner else path.parent if path.is_file() else path
        pack.add_folder(place, home, what)
        moved["path"] = f"{place}/{path.relative_to(home).as_posix()}".removesuffix("/.")
    if "pictures" in entry:
        pictures = resolve_path(entry["pictures"], folder)
        moved["pictures"] = pack.add_folder(f"{place}/pictures", pictures, f"pictures of {what}")
    if "ignore_regions" in entry:
        moved["ignore_regions"] = _pack_regions(entry, folder, place, pack)
    return moved


def _pack_regions(entry: dict[str, Any], folder: Path, place: str, pack: Pack) -> str:
    regions = resolve_path(entry["ignore_regions"], folder)
    return pack.add_file(f"{place}-ignore/{regions.name}", regions, "ignored regions")


def recipe_mixture(data: Path, pack: Pack) -> dict[str, Any]:
    """Add the scripts that make the data sets; of a mixture only sets in $DATA are made by them.

    Returns:
        The mixture as it stands in the archive.
    """
    if not is_mixture(data):
        raise ConfigError(
            expected="a mixture with sets in $DATA for --recipe", found=str(data), fix="leave --recipe out"
        )
    read_mixture(data)
    content, sources = read_yaml(data), []
    for entry in content["sources"]:
        moved = dict(entry)
        for key in ("path", "pictures"):
            if key in entry and not _OF_DATA.match(entry[key]):
                raise ConfigError(
                    expected=f"sets in $DATA, which make_data.sh makes, in {data}",
                    found=entry[key],
                    fix="leave --recipe out, or take this set out of a copy of the mixture",
                )
        moved |= {key: _OF_DATA.sub("data/", entry[key]) for key in ("path", "pictures") if key in entry}
        if "ignore_regions" in entry:
            place = pack.free_place(entry.get("name", Path(entry["path"]).name))
            moved["ignore_regions"] = _pack_regions(entry, data.parent, place, pack)
        sources.append(moved)
    for name in RECIPE:
        pack.add_file(f"recipe/{name}", HERE / name, "the recipe")
    return content | {"sources": sources}


def check_moved(pack: Pack, before: LabelledData) -> None:
    """Read the packed data as it will be read there: only files of the archive, and all as here.

    Raises:
        DataError: A set lists what lies outside of it, or is read otherwise.
    """
    with TemporaryDirectory() as folder:
        root = Path(folder)
        for place, path in pack.files.items():
            (root / place).parent.mkdir(parents=True, exist_ok=True)
            (root / place).symlink_to(path.resolve())
        (root / "mixture.yaml").write_text(pack.texts["mixture.yaml"], encoding="utf-8")
        advice = "let its data.yaml or lists name pictures relative to themselves and inside its folder"
        try:
            after = read_data(root / "mixture.yaml")
        except DataError as error:
            found = str(error).replace(f"{root}/", "")
            raise DataError(
                expected="data sets that can be read where they are unpacked", found=found, fix=advice
            ) from error
        for split, pictures in after.splits.items():
            outside = next(
                (one.path for one in pictures if not Path(os.path.normpath(one.path)).is_relative_to(root)), None
            )
            if outside is not None:
                raise DataError(
                    expected="pictures inside the data sets that are packed", found=str(outside), fix=advice
                )
            if list(_marks(before, split)) != list(_marks(after, split)):
                found = f"{len(pictures)} of {len(before.splits[split])} pictures of {split}, or other boxes"
                raise DataError(expected="the packed data to be read as they are here", found=found, fix=advice)


def _marks(data: LabelledData, split: Any) -> Iterator[tuple[object, ...]]:  # noqa: ANN401
    for one in data.splits[split]:
        arrays = (one.xyxy_px, one.class_id, one.ignored, one.foot_px)
        yield one.path.name, one.group, one.weight, *(array.tobytes() for array in arrays)


def pack_plan(config: Path, pack: Pack, *, is_recipe: bool) -> dict[str, Any]:
    """Add a plan, its mixture with the data or their recipe, its weights and its network.

    Returns:
        Facts for packed.json.
    """
    given = read_plan(config)
    plan = make_plan(given, str(config))
    if plan.arch not in ARCHITECTURES and not plan.arch.endswith(".cfg"):
        raise ConfigError(expected=f"one of {', '.join(ARCHITECTURES)} or a .cfg", found=plan.arch, fix="correct arch")
    # Every setting, so that the same is trained by whichever standoff is there.
    packed = plan.to_dict() | {"data": "mixture.yaml", "weights": None}
    if plan.arch.endswith(".cfg"):
        packed["arch"] = pack.add_file(f"arch/{Path(plan.arch).name}", Path(plan.arch), "the network")
    if given.get("weights") in SHIPPED_MODELS:
        packed["weights"] = given["weights"]
    elif plan.weights is not None:
        if not plan.weights.is_file():
            raise ModelError(expected=f"weights at {plan.weights}", found="nothing", fix="check `weights` of the plan")
        packed["weights"] = pack.add_file(f"weights/{plan.weights.name}", plan.weights, "the weights")
        for beside in (plan.weights.resolve().with_name(name) for name in BESIDE_WEIGHTS):
            if beside.is_file():
                pack.add_file(f"weights/{beside.name}", beside, "what the weights know")
    facts: dict[str, Any] = {"weights": packed["weights"], "pictures": None}
    facts["weights_sha256"] = None if plan.weights is None else file_sha256(plan.weights)
    if is_recipe:
        mixture = recipe_mixture(plan.data, pack)
    else:
        data = read_data(plan.data)
        require_splits(data, ("train", "val"))
        mixture = pack_mixture(plan.data, pack)
        facts["pictures"] = {split: len(pictures) for split, pictures in data.splits.items()}
    pack.texts["plan.yaml"] = dump_yaml(packed)
    pack.texts["mixture.yaml"] = dump_yaml(plain(mixture))
    if not is_recipe:
        check_moved(pack, data)
    return facts


def pack_software(pack: Pack, folder: Path, arguments: argparse.Namespace) -> None:
    """Add standoff's wheel, the lock, what is to be installed, and on request its wheels."""
    wheels = [arguments.wheel or _build_wheel(ROOT, folder)]
    if arguments.recipe:
        wheels.append(arguments.simulator_wheel or _build_wheel(ROOT / "simulator", folder))
    for one in wheels:
        pack.add_file(one.name, one, "standoff's wheel")
    lock = ROOT / "requirements.lock"
    pack.add_file(lock.name, lock, "the lock")
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    wanted = extras["train"]
    # The machine's own torch is built for its GPU: run.sh sees to it.
    own = [one for one in wanted if not one.startswith("torch")]
    pack.texts["requirements.txt"] = "".join(f"{one}\n" for one in (*(f"./{wheel.name}" for wheel in wheels), *own))
    pack.add_file("run.sh", HERE / "run_packed.sh", "run.sh")
    if not arguments.wheels:
        return
    runtime = re.search(r"^onnxruntime==(\S+)$", lock.read_text(encoding="utf-8"), re.MULTILINE)
    assert runtime is not None, "onnxruntime is a dependency"
    more = [f"onnxruntime-gpu=={runtime[1]}", *(one for one in wanted if arguments.torch and one not in own)]
    version = ["--python-version", arguments.python] if arguments.python else []
    # wheels of files that a dependency has as source only could not be installed without compilers
    _pip("download", "--dest", str(folder / "wheels"), "--only-binary=:all:", *version,
         "--constraint", str(lock), *map(str, wheels), *own, *more)  # fmt: skip
    for path in _walk(folder / "wheels"):
        if path.name not in [one.name for one in wheels]:
            pack.add_file(f"wheels/{path.name}", path, "a wheel")


def _build_wheel(source: Path, folder: Path) -> Path:
    before = set(folder.glob("*.whl"))
    _pip("wheel", "--no-deps", "--wheel-dir", str(folder), str(source))
    return (set(folder.glob("*.whl")) - before).pop()


def _pip(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", "pip", "--quiet", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line.strip()] or ["nothing"]
        found = next((line for line in said if line.startswith("ERROR")), said[-1])
        raise MissingDependency(expected=f"pip {words[0]} to end well", found=found, fix="see to pip, or give --wheel")


def write_archive(out: Path, pack: Pack) -> None:
    """Write the archive, whole or not at all; everything lies in one folder, named as it is."""
    top = out.stem
    with whole_file(out) as partial, tarfile.open(partial, "w", dereference=True) as archive:
        for place, text in sorted(pack.texts.items()):
            content = text.encode()
            entry = tarfile.TarInfo(f"{top}/{place}")
            entry.size, entry.mtime = len(content), int(time.time())
            archive.addfile(entry, io.BytesIO(content))
        for place, path in sorted(pack.files.items()):
            archive.add(path, f"{top}/{place}", filter=_nobodys)


def _nobodys(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Leave out whose files they were: nobody of that name is there."""
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = ""
    entry.mode = 0o755 if entry.name.endswith(".sh") else 0o644
    return entry


def _commit() -> str | None:
    words = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False)
    except OSError:
        return None
    return done.stdout.strip() or None


def _read_arguments(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", type=Path, required=True, help="the plan, as standoff train takes it")
    parser.add_argument("--out", type=Path, required=True, help="the archive to write, NAME.tar")
    parser.add_argument("--recipe", action="store_true", help="make_data.sh in place of the data sets")
    parser.add_argument("--wheels", action="store_true", help="the wheels of all dependencies, too, but of torch")
    parser.add_argument("--torch", action="store_true", help="with --wheels: torch, too, as pip finds it here")
    parser.add_argument("--python", metavar="3.N", help="with --wheels: for this Python; left out: for the one here")
    parser.add_argument("--wheel", type=Path, help="standoff's wheel, built already")
    parser.add_argument("--simulator-wheel", type=Path, help="with --recipe: the simulator's wheel, built already")
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    """Pack; return the exit code: 2 where something must be put right, said in one line."""
    arguments = _read_arguments(words)
    out: Path = arguments.out
    try:
        if out.suffix != ".tar" or not out.parent.is_dir():
            raise OutputError(expected="--out NAME.tar in an existing folder", found=str(out), fix="correct it")
        if (arguments.torch or arguments.python) and not arguments.wheels:
            raise ConfigError(expected="--torch and --python with --wheels", found="no --wheels", fix="add it")
        pack = Pack()
        facts = pack_plan(arguments.config, pack, is_recipe=arguments.recipe)
        with TemporaryDirectory() as folder:
            pack_software(pack, Path(folder), arguments)
            facts |= {"standoff": __version__, "commit": _commit()}
            facts["kinds"] = dict(sorted(Counter(Path(place).parts[0] for place in pack.files).items()))
            pack.texts["packed.json"] = json.dumps(facts, indent=2) + "\n"
            write_archive(out, pack)
    except StandoffError as error:
        print(f"pack_training: {error}", file=sys.stderr)
        return 2
    print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB, {len(pack.files)} files)")
    print(f"there: tar xf {out.name} && {out.stem}/run.sh    (STEPS=10 to try it)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
