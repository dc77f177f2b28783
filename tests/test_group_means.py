import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reference.group_means import GroupMeans


@given(
    st.lists(st.tuples(st.integers(0, 3), st.floats(0.1, 5), st.floats(-9, 9)), min_size=1, max_size=30),
    st.floats(0.5, 2),
)
def test_they_are_the_weighted_means_of_each_group(rows: list[tuple[int, float, float]], scale: float) -> None:
    group, weights, values = (np.array(column) for column in zip(*rows, strict=True))
    group = np.unique(group, return_inverse=True)[1].reshape(-1)
    means = GroupMeans(group, weights)
    both = means(np.stack((values, scale * values), axis=1))
    for number in range(group.max() + 1):
        of_it = group == number
        assert np.isclose(both[number, 0], np.average(values[of_it], weights=weights[of_it]))
        assert np.isclose(means.total[number], weights[of_it].sum())
    assert np.allclose(both[:, 1], scale * both[:, 0])
