#!/usr/bin/env python3
"""Writes the small files that fuzzing starts from into seeds/<target>/."""
import base64, io, json, pathlib, struct, zipfile

ROOT = pathlib.Path(__file__).parent / "seeds"
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = [t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))]


def put(target, name, data):
    folder = ROOT / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def obj():
    text = "o box\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    put("obj", "quads", text + "".join("f %d %d %d %d\n" % tuple(i + 1 for i in q) for q in QUADS))
    put("obj", "relative", text + "f -8/1/1 -7//2 -5 \\\n -6 # end\nv 1 2 3 0.5\nf 1 2 9\n")


def stl():
    text = "solid box\n"
    binary = bytearray(80) + struct.pack("<I", len(TRIANGLES))
    for t in TRIANGLES:
        text += "facet normal 0 0 0\nouter loop\n"
        text += "".join("vertex %g %g %g\n" % CORNERS[i] for i in t) + "endloop\nendfacet\n"
        binary += struct.pack("<12fH", 0, 0, 0, *(x for i in t for x in CORNERS[i]), 0)
    put("stl", "ascii", text + "endsolid box\nsolid\nendsolid\n")
    put("stl", "binary", bytes(binary))


def ply():
    def header(kind):
        return (f"ply\nformat {kind} 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
                "property float z\nelement face 6\nproperty list uchar int vertex_indices\n"
                "end_header\n")
    rows = "".join("%g %g %g\n" % c for c in CORNERS) + "".join("4 %d %d %d %d\n" % q for q in QUADS)
    put("ply", "ascii", header("ascii") + rows)
    for kind, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        data = b"".join(struct.pack(order + "3f", *c) for c in CORNERS)
        data += b"".join(struct.pack(order + "B4i", 4, *q) for q in QUADS)
        put("ply", kind, header(kind).encode() + data)


def gltf():
    data = b"".join(struct.pack("<3f", *c) for c in CORNERS)
    data += b"".join(struct.pack("<3H", *t) for t in TRIANGLES)
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [2, 1, -1]},
                  {"mesh": 0, "name": "box", "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8,
                       "min": [0, 0, 0], "max": [1, 1, 1]},
                      {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 96},
                        {"buffer": 0, "byteOffset": 96, "byteLength": 72}],
        "buffers": [{"byteLength": 168}]}
    text = json.dumps(document, separators=(",", ":"))
    text += " " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text.encode()
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    put("gltf", "binary", struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    document["buffers"][0]["uri"] = uri
    put("gltf", "text", json.dumps(document, separators=(",", ":")))


def threemf():
    mesh = "<mesh><vertices>" + "".join('<vertex x="%g" y="%g" z="%g"/>' % c for c in CORNERS)
    mesh += "</vertices><triangles>" + "".join(
        '<triangle v1="%d" v2="%d" v3="%d"/>' % t for t in TRIANGLES) + "</triangles></mesh>"
    model = (f'<model unit="millimeter"><resources><object id="1" name="box">{mesh}</object>'
             '<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
             '</components></object></resources><build><item objectid="2"/></build></model>')
    put("threemf_model", "box", model)
    rels = ('<Relationships><Relationship Target="/3D/3dmodel.model" Type="http://schemas.microsoft'
            '.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>')
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, text, kind in (("_rels/.rels", rels, zipfile.ZIP_STORED),
                                 ("3D/3dmodel.model", model, zipfile.ZIP_DEFLATED)):
            archive.writestr(zipfile.ZipInfo(name), text, kind)
    put("threemf", "box", out.getvalue())


def field():
    def solid(flags, points, triangles):
        flat = bytes(x for p in points for x in p) + bytes(i for t in triangles for i in t)
        return bytes([flags, len(points)]) + flat + bytes(max(0, 6 * len(points) - len(flat)))
    put("field", "box", solid(0, CORNERS, TRIANGLES))
    # A grid of 4 x 4 squares above, a fan below: regions of many triangles.
    grid = [(x, y, 2) for x in range(5) for y in range(5)]
    above = [t for x in range(4) for y in range(4) for a in [5 * x + y]
             for t in ((a, a + 5, a + 6), (a, a + 6, a + 1))]
    ring = [0, 1, 2, 3, 4, 9, 14, 19, 24, 23, 22, 21, 20, 15, 10, 5]
    fan = [(25, a, b) for a, b in zip(ring, ring[1:] + ring[:1])]
    put("field", "pyramid", solid(2, grid + [(2, 2, 0)], above + fan))


def repair():
    cells = b"".join(struct.pack("<3h", *c) for c in CORNERS)
    faces = bytes(i for t in TRIANGLES for i in t)
    put("repair", "box", bytes([0, 8]) + cells + faces)
    halves = b"".join(b"".join(struct.pack("<f", x)[2:] for x in c) for c in CORNERS)
    put("repair", "floats", bytes([1, 8]) + halves + faces + faces[:9])


def programs():
    put("scene", "short", 'unit = "mm"\nfixed = "hole.obj"\nmoving = "peg.obj"\n')
    put("scene", "long", 'unit = "mm"\nmoving = "peg.obj"\n[fixed]\nmesh = "h.stl"\nsolid = 2\n'
        'position = [1, 2, 3]\nrotation = [0, 0, 0, 1]\n[model]\npreset = "paper"\nsigma = 0.1\n'
        '[lattice]\npoints = 40\n[window]\nhalf_extent = [1, 2, 3]\n[rotations]\nkind = "ball"\n'
        'angle_deg = 20\nstep_deg = 5\n[energy]\npeak_force = 5\n[fit]\naxis = [0, 0, -1]\n'
        '[device]\nworkspace_scale = 0.5\n')
    # A joystick: two axes of 8 bits and two buttons.
    put("hid_report", "joystick", bytes.fromhex(
        "05010904a101a10009300931150026ff00750895028102c005091901290215002501750195028102"
        "750695018103c0"))
    for which in range(3):
        put("table", f"file{which}", bytes([which]) + b'{"zarr_format":3,"node_type":"group"}')
    put("replay", "header", "tick,time,dt,x,y,z,qx,qy,qz,qw\n0,0,0.001,0,0,0,0,0,0,1\n")


for make in (obj, stl, ply, gltf, threemf, repair, field, programs):
    make()
