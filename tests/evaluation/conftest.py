import pytest


@pytest.fixture
def rendered(monkeypatch):
    """Matplotlib's figures, in the order in which they are rendered."""
    figure = pytest.importorskip("matplotlib.figure")
    seen = []
    save = figure.Figure.savefig

    def record(drawn, *arguments, **options):
        seen.append(drawn)
        return save(drawn, *arguments, **options)

    monkeypatch.setattr(figure.Figure, "savefig", record)
    return seen
