"""The moving average of the weights."""

import pytest

torch = pytest.importorskip("torch")

from ssiam.training.optimizer import WeightAverage  # noqa: E402

KEPT = 0.9


def network(value, batches):
    """A network with all weights equal to `value`, trained on a number of batches."""
    built = torch.nn.BatchNorm1d(3)
    for each in built.state_dict().values():
        each.fill_(value if each.is_floating_point() else batches)
    return built


def values(average):
    """The value of all weights, and the number of batches."""
    state = average.network.state_dict()
    found = {round(float(v), 6) for each in state.values() if each.dim() for v in each}
    assert len(found) == 1
    return found.pop(), int(state["num_batches_tracked"])


def test_the_average_keeps_its_share_in_each_step():
    average, late = WeightAverage(network(1.0, 7), KEPT), 1000
    average.update(network(2.0, 8), late)
    assert values(average) == (pytest.approx(1.1), 8)
    average.update(network(2.0, 9), late + 1)
    assert values(average) == (pytest.approx(2 - KEPT**2), 9)


@pytest.mark.parametrize(("step", "kept"), [(0, 1 / 10), (8, 9 / 18), (71, 72 / 81), (80, 0.9)])
def test_the_first_steps_keep_less(step, kept):
    average = WeightAverage(network(0.0, 0), KEPT)
    average.update(network(1.0, 1), step)
    assert values(average)[0] == pytest.approx(1 - kept, abs=1e-5)


def test_the_network_that_is_followed_stays_as_it_is():
    followed = network(1.0, 0)
    average = WeightAverage(followed, KEPT)
    average.update(network(3.0, 0), 1000)
    assert float(followed.weight[0].detach()) == 1
    assert not average.network.training
    assert not any(each.requires_grad for each in average.network.parameters())
