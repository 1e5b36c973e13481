"""What notebooks show: the pair, its docked poses with their mates, and the path."""

import html
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import pegfit
from conftest import about, turned
from pegfit._notebook import Surface, drawing, number, pose_words

SVG = "{http://www.w3.org/2000/svg}"


def parsed(text):
    """Well-formed, without a script and without an address to fetch."""
    assert "<script" not in text and " href" not in text and " src=" not in text
    return ElementTree.fromstring(text)


def paths(picture):
    return [path.attrib for path in picture.iter(f"{SVG}path")]


def sphere(rings):
    """A closed surface of 4 rings^2 faces, about."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    across = [np.outer(np.sin(theta), f(phi)).ravel() for f in (np.cos, np.sin)]
    high = np.repeat(np.cos(theta), len(phi))
    vertices = np.vstack([np.stack([*across, high], axis=1), [[0, 0, 1], [0, 0, -1]]])
    ring = np.arange(len(phi))
    after = np.roll(ring, -1)
    faces, top = [], len(vertices) - 2
    for k in range(len(theta) - 1):
        a, b = k * len(phi), (k + 1) * len(phi)
        faces += [np.stack([a + ring, b + ring, b + after], 1)]
        faces += [np.stack([a + ring, b + after, a + after], 1)]
    last = (len(theta) - 1) * len(phi)
    faces += [np.stack([0 * ring + top, ring, after], 1)]
    faces += [np.stack([0 * ring + top + 1, last + after, last + ring], 1)]
    return Surface(0.01 * vertices, np.concatenate(faces).astype(np.uint32))


def test_parts_are_where_the_scene_places_them(placed):
    """The pose that fits takes the moving part into the hole, whatever the placement."""
    assert placed.fixed.bounds.min() > -0.5 and "fixed of" in placed.fixed.name
    peg, hole = placed.moving, placed.fixed
    at = turned(placed.assembled[3:], peg.vertices) + placed.assembled[:3]
    middle = [part.mean(axis=0) for part in hole.bounds[None]]
    assert np.abs(at.mean(axis=0) - middle[0]).max() < 5e-3
    assert np.linalg.norm(peg.vertices.mean(axis=0) - [-0.1, 0.5, 0.4]) < 5e-3
    meshes = pegfit.peg_in_hole("rectangular")
    pair = pegfit.Pair(*meshes, spacing=0.002)
    for one, given in zip((pair.fixed, pair.moving), meshes):
        np.testing.assert_array_equal(one.vertices, given.vertices)
        assert one.name == given.name


def test_a_picture_has_the_faces_and_edges_that_a_viewer_sees():
    hole, peg = (Surface(m.vertices, m.faces) for m in pegfit.peg_in_hole("rectangular"))
    picture = parsed(drawing(hole, peg))
    glass, *faces, lines = paths(picture)
    # Three sides of the peg, of two triangles each; twelve edges outside and twelve of the hole.
    assert len(faces) == 6 and len({face["fill"] for face in faces}) == 3
    assert lines["d"].count("M") == 24
    points = np.array(re.findall(r"[\d.]+ [\d.]+", glass["d"] + lines["d"]))
    numbers = np.array([point.split() for point in points], float)
    assert numbers.min() >= 5.5 and (numbers.max(axis=0) <= [194.5, 144.5]).all()


def test_what_is_nearer_hides_what_is_farther():
    """A thin box in front of another, and behind it."""
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 0.01) for z in (0, 1)], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([f for a, b, c, d in sides for f in ([a, b, c], [a, c, d])], np.uint32)
    both = Surface(np.vstack([box, box + [0, 1, 0]]), np.vstack([faces, faces + 8]))
    from pegfit._notebook import _faces, _Sheet

    _, numbers, _ = _faces(both, _Sheet(both.vertices))
    # The viewer looks along +y: what lies at y = 1 is drawn first.
    assert (numbers[:6] >= 12).all() and (numbers[6:] < 12).all() and len(numbers) == 12


def test_fine_parts_are_drawn_coarser():
    fine = sphere(120)
    assert len(fine.faces) > 50_000
    text = drawing(fine, fine)
    assert len(text) < 300_000
    glass, *faces, _ = paths(parsed(text))
    assert 300 < len(faces) <= 1500


def test_a_pair_is_shown_as_it_fits(pair):
    shown = parsed(pair._repr_html_())
    assert len(list(shown.iter(f"{SVG}svg"))) == 1
    assert shown.find("figcaption").text == repr(pair)


def test_names_are_no_markup():
    meshes = [
        pegfit.Mesh(m.vertices, m.faces, "m", name="<b>&\"'") for m in pegfit.peg_in_hole()
    ]
    shown = parsed(pegfit.Pair(*meshes, spacing=0.002)._repr_html_())
    assert "<b>&" in shown.find("figcaption").text


def test_docked_poses_are_a_table_with_their_mates(pair):
    found = pair.dock(top=2)
    shown = parsed(found._repr_html_()).find("table")
    rows = shown.find("tbody").findall("tr")
    assert len(rows) == len(found) > 0 and shown.find("caption").text == repr(found)
    for k, row in enumerate(rows):
        picture, place, mate, free, information, quality, overlap = row
        assert place.text == pose_words(found.poses[k])
        assert mate.text.startswith(found.joints[k].kind)
        assert free.text == str(found.joints[k].freedoms)
        assert float(information.text.split()[0]) == pytest.approx(found.information[k], abs=0.06)
        assert float(quality.text) == pytest.approx(found.quality[k], rel=1e-2)
        assert overlap.text.endswith(" %")
        drawn = paths(picture)
        assert ("stroke-dasharray" in drawn[-1]) == np.isfinite(found.joints[k].axis).all()


def test_numbers_and_poses_are_in_words():
    assert number(np.nan) == "–" and number(0.12345) == "0.123"
    at = np.array([1e-3, -1e-9, 0.02, 0, 0, 0, 1])
    assert pose_words(at) == "(1.000, 0.000, 20.000) mm"
    for sign in (1, -1):
        turn = sign * about([0, 0, 2], np.radians(30))
        words = pose_words(np.append([0, 0, 0], turn))
        assert words == "(0.000, 0.000, 0.000) mm, 30.0° about (0.00, 0.00, 1.00)"
    half = about([0, 1, 0], np.pi)
    assert "180.0° about (0.00, 1.00, 0.00)" in pose_words(np.append([0, 0, 0], half))


def test_a_path_is_its_page_in_a_frame(tmp_path):
    pair = pegfit.Pair(*pegfit.peg_in_hole("rectangular", clearance=2e-4))
    path = pair.path(solids_only=True)
    frame = re.fullmatch(r'<iframe srcdoc="([^"]*)" style="[^"]*" title="[^"]*"></iframe>',
                         path._repr_html_())
    path.report(tmp_path / "path.html")
    assert html.unescape(frame[1]) == (tmp_path / "path.html").read_text()
