import pytest

torch = pytest.importorskip("torch")

from ssiam.networks.correlation import (  # noqa: E402
    correlate,
    correlate_all,
    correlate_all_sliced,
    correlate_sliced,
)


@pytest.mark.parametrize(
    ("convolved", "sliced", "crops", "channels", "side", "kernel"),
    [
        pytest.param(correlate, correlate_sliced, 1, 256, 29, 5, id="SiamRPN++ and SiamMask"),
        pytest.param(correlate, correlate_sliced, 1, 256, 24, 4, id="SiamRPN++ with AlexNet"),
        pytest.param(correlate_all, correlate_all_sliced, 3, 256, 22, 6, id="SiamFC"),
    ],
)
def test_the_sliced_form_equals_the_convolution(convolved, sliced, crops, channels, side, kernel):
    random = torch.Generator().manual_seed(0)
    search = torch.randn(crops, channels, side, side, generator=random)
    template = torch.randn(1, channels, kernel, kernel, generator=random)
    expected = convolved(search, template)
    assert expected.shape[-1] == side - kernel + 1
    assert torch.allclose(sliced(search, template), expected, rtol=0, atol=1e-5 * expected.max())


def test_pairs_of_a_batch_are_independent():
    random = torch.Generator().manual_seed(0)
    search = torch.randn(2, 3, 9, 8, generator=random)
    kernel = torch.randn(2, 3, 5, 5, generator=random)
    single = torch.cat([correlate(search[i : i + 1], kernel[i : i + 1]) for i in range(2)])
    assert torch.allclose(correlate(search, kernel), single, atol=1e-5)
    assert torch.allclose(correlate_sliced(search, kernel), single, atol=1e-5)


def test_channels_are_independent():
    search = torch.zeros(1, 2, 3, 4)
    search[0, 1, 2, 3] = 5
    kernel = torch.arange(8.0).reshape(1, 2, 2, 2)
    expected = torch.zeros(1, 2, 2, 3)
    expected[0, 1, 1, 2] = 5 * 7
    assert torch.equal(correlate(search, kernel), expected)
    assert torch.equal(correlate_sliced(search, kernel), expected)
