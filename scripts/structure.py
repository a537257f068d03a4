"""Count what makes a package hard to read: small files, files with one importer, odd words.

    python scripts/structure.py                          # this package
    python scripts/structure.py PATH/TO/site-packages/kornia

Words are counted in the Python files of the package and, for this project, in README.md and docs/.
The numbers are per 10,000 words. An identifier is split into its words.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]

# Words that are rare in plain technical texts, with a regular expression for each.
WORDS = {
    "told, tell, tells": r"\b(?:told|tells?)\b",
    "picture(s)": r"\bpictures?\b",
    "place(s), as a noun": r"\b(?:the|a|its|this|that|another|which|other|one|no|of|in|by|whose)"
    r" places?\b(?! of\b)|\bplaces\b",
    "lies": r"\blies\b",
    "steady, steadied, steadying": r"\b(?:un)?stead(?:y|ied|ies|ying)\b",
    "is no": r"\bis no\b",
    "of its own": r"\bof its own\b",
}


def words_of(path: Path) -> list[str]:
    """The words of a text, identifiers split at underscores and capitals, in lower case."""
    text = path.read_text(encoding="utf-8", errors="ignore")
    text = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", text).replace("_", " ")
    return re.findall(r"[a-z]+(?:'[a-z]+)?", text.lower())


def frequencies(paths: list[Path]) -> dict[str, float]:
    """Occurrences of each of WORDS per 10,000 words."""
    total, counts = 0, dict.fromkeys(WORDS, 0)
    for path in paths:
        words = words_of(path)
        total += len(words)
        text = " ".join(words)
        for name, pattern in WORDS.items():
            counts[name] += len(re.findall(pattern, text))
    return {name: 1e4 * count / total for name, count in counts.items()}


def modules_of(package: Path) -> dict[str, Path]:
    """The files of a package by dotted module name, without `__init__` files."""
    return {
        ".".join(path.relative_to(package.parent).with_suffix("").parts): path
        for path in sorted(package.rglob("*.py"))
        if path.name != "__init__.py"
    }


def importers(package: Path) -> dict[str, set[str]]:
    """The modules that import each module of a package."""
    modules = modules_of(package)
    result: dict[str, set[str]] = defaultdict(set)
    for path in sorted(package.rglob("*.py")):
        name = ".".join(path.relative_to(package.parent).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                targets = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                targets = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            else:
                continue
            for target in set(targets) & modules.keys():
                result[target].add(name)
    return result


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("package", nargs="?", type=Path, default=ROOT / "src" / "ssiam")
    parser.add_argument("--list", action="store_true", help="name the files with one importer")
    args = parser.parse_args()
    package = args.package.resolve()
    modules = modules_of(package)
    imported_by = importers(package)
    single = sorted(name for name in modules if len(imported_by[name]) == 1)
    lines = [len(path.read_text(encoding="utf-8").splitlines()) for path in modules.values()]
    print(f"files                   {len(modules)}")
    print(f"median lines            {sorted(lines)[len(lines) // 2]}")
    print(f"files of one importer   {len(single)}")
    if args.list:
        for name in single:
            print(f"    {name}  <-  {', '.join(imported_by[name])}")
    texts = sorted(package.rglob("*.py"))
    if package.is_relative_to(ROOT) or (package.parents[1] / "docs").is_dir():
        root = package.parents[1]
        texts += [root / "README.md", *sorted((root / "docs").rglob("*.md"))]
    print("per 10,000 words")
    for name, value in frequencies(texts).items():
        print(f"    {name:30} {value:6.2f}")


if __name__ == "__main__":
    main()
