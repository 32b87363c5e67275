"""``python -m pipelines``: lists the studies."""

from pathlib import Path

from cmacexp.study.study import load_study


def main() -> None:
    """Print the name, title and question of every study."""
    for page in sorted(Path(__file__).parent.glob("*.md")):
        file = load_study(page.with_suffix(".py"))
        print(f"python -m pipelines.{file.name}\n    {file.study.title}: {file.study.question}")


if __name__ == "__main__":
    main()
