"""The page: it is served, may stand in a frame of a notebook, and ends with its owner."""

import gc
import urllib.error
import urllib.request

import pytest

import pegfit


def fetch(url):
    with urllib.request.urlopen(url, timeout=20) as reply:
        return reply.headers, reply.read().decode()


@pytest.mark.parametrize("gamma", [None, 3.0])
def test_a_pair_is_played_until_its_page_is_closed(gamma):
    pair = pegfit.Pair(
        *pegfit.peg_in_hole("rectangular", clearance=1e-3),
        spacing=0.0025,
        half_extent=0.005,
        gamma=gamma,
    )
    with pegfit.play(pair, height=500) as page:
        headers, body = fetch(page.url)
        assert "frame-ancestors http://localhost:*" in headers["Content-Security-Policy"]
        assert "pegfit" in body
        frame = page._repr_html_()
        assert f'src="{page.url}"' in frame and "height: 500px" in frame
        url = page.url
    assert "closed" in page._repr_html_() and "closed" in repr(page)
    with pytest.raises(urllib.error.URLError):
        fetch(url)


def test_a_page_that_nobody_refers_to_ends():
    page = pegfit.play()
    url = page.url
    fetch(url)
    del page
    gc.collect()
    with pytest.raises(urllib.error.URLError):
        fetch(url)


def test_what_cannot_be_played_says_why(tmp_path):
    with pytest.raises(pegfit.PegfitError, match="no-such-scene"):
        pegfit.play(tmp_path / "no-such-scene.toml")
