import matplotlib as mpl
import matplotlib.pyplot as plt
import pytest


@pytest.fixture(autouse=True)
def _close_figures():
    mpl.use("Agg")
    plt.close("all")  # what a test of another room has left open
    yield
    plt.close("all")
