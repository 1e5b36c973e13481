# Turns a STEP file into an ASCII STL file in metres, one solid for each solid in it, under its
# name. Run by Pegfit:  python step.py MODULE IN.step OUT.stl SEGMENTS_PER_TURN
# MODULE is gmsh or OCP. What else is to be said goes into OUT.stl.ledger, a line an item: kind,
# item, count and reason between tabs.
# Exits with 69 if the module cannot be imported, with 70 if the file has no solid.
import sys

# Edges are not made shorter than this part of the diagonal: tips of cones and slivers of faces
# would be cut without end.
LEAST = 1e-3


def with_gmsh(gmsh, source, segments, say):
    """Yields (name, [triangle]) per solid, a triangle being three points."""
    gmsh.initialize(["gmsh", "-noenv"], interruptible=False)
    option = gmsh.option.setNumber
    option("General.Terminal", 0)
    option("General.AbortOnError", 2)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    gmsh.open(source)
    solids = gmsh.model.getEntities(3)
    bounding = set()
    for solid in solids:
        bounding.update(gmsh.model.getBoundary([solid], oriented=False))
    loose = [face for face in gmsh.model.getEntities(2) if face not in bounding]
    say_loose(say, len(loose))
    if not solids:
        return
    # Faces that bound no solid need no triangles.
    gmsh.model.removeEntities(loose, recursive=False)
    boxes = [gmsh.model.getBoundingBox(*solid) for solid in solids]
    sides = [max(b[k + 3] for b in boxes) - min(b[k] for b in boxes) for k in range(3)]
    diagonal = sum(side ** 2 for side in sides) ** 0.5
    option("Mesh.MeshSizeFromCurvature", segments)
    option("Mesh.MeshSizeMin", LEAST * diagonal)
    say("assumed", "least edge", 1, f"{LEAST * diagonal:.3g} m, {LEAST:g} of the diagonal")
    gmsh.model.mesh.generate(2)
    for dim, tag in solids:
        triangles = []
        # Gmsh turns the triangles of faces that are reversed in their solid itself.
        for _, face in gmsh.model.getBoundary([(dim, tag)], oriented=False):
            nodes, where, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            point = {n: [float(x) for x in where[3 * i:3 * i + 3]] for i, n in enumerate(nodes)}
            corners = gmsh.model.mesh.getElementsByType(2, face)[1]
            triangles += [
                [point[n] for n in corners[i:i + 3]] for i in range(0, len(corners), 3)
            ]
        yield gmsh.model.getEntityName(dim, tag).split("/")[-1], triangles


def with_open_cascade(source, segments, say):
    """The same with Open CASCADE alone (pip install cadquery-ocp)."""
    import math

    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool
    from OCP import TDF, TopoDS

    def static(owner, name):
        """A static function, whose name has a suffix in some versions of the module."""
        return getattr(owner, name + "_s", None) or getattr(owner, name)

    # What was a class of static functions is a module in Open CASCADE 8.
    as_face = static(getattr(TopoDS, "TopoDS", TopoDS), "Face")

    def label_sequence():
        """An empty list of labels, whose class is elsewhere in Open CASCADE 8."""
        if hasattr(TDF, "TDF_LabelSequence"):
            return TDF.TDF_LabelSequence()
        from OCP.collections import Sequence_TDF_Label

        return Sequence_TDF_Label()

    document = TDocStd_Document(TCollection_ExtendedString("pegfit"))
    static(XCAFDoc_DocumentTool, "SetLengthUnit")(document, 1.0)
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    if reader.ReadFile(source) != IFSelect_RetDone or not reader.Transfer(document):
        raise RuntimeError("not a STEP file")
    tool = static(XCAFDoc_DocumentTool, "ShapeTool")(document.Main())

    def name_of(label):
        name = TDataStd_Name()
        found = label.FindAttribute(static(TDataStd_Name, "GetID")(), name)
        return name.Get().ToExtString() if found else ""

    def shapes(label, location):
        """Every shape that is placed, with its name and place."""
        referred = TDF_Label()
        if static(XCAFDoc_ShapeTool, "GetReferredShape")(label, referred):
            location = location * static(XCAFDoc_ShapeTool, "GetLocation")(label)
            yield from shapes(referred, location)
            return
        parts = label_sequence()
        if static(XCAFDoc_ShapeTool, "GetComponents")(label, parts):
            for i in range(1, parts.Length() + 1):
                yield from shapes(parts.Value(i), location)
            return
        yield name_of(label), static(XCAFDoc_ShapeTool, "GetShape")(label), location

    def explore(*what):
        found = TopExp_Explorer(*what)
        while found.More():
            yield found.Current()
            found.Next()

    roots = label_sequence()
    tool.GetFreeShapes(roots)
    loose = 0
    for i in range(1, roots.Length() + 1):
        for name, shape, location in shapes(roots.Value(i), TopLoc_Location()):
            loose += sum(1 for _ in explore(shape, TopAbs_FACE, TopAbs_SOLID))
            for solid in explore(shape, TopAbs_SOLID):
                solid = solid.Moved(location)
                BRepMesh_IncrementalMesh(solid, 1e-3, True, 2 * math.pi / segments)
                triangles = []
                for face in explore(solid, TopAbs_FACE):
                    at = TopLoc_Location()
                    mesh = static(BRep_Tool, "Triangulation")(as_face(face), at)
                    turned = face.Orientation() == TopAbs_REVERSED
                    for k in range(1, mesh.NbTriangles() + 1 if mesh else 1):
                        a, b, c = mesh.Triangle(k).Get()
                        corners = (mesh.Node(n).Transformed(at.Transformation())
                                   for n in ((a, c, b) if turned else (a, b, c)))
                        triangles.append([(p.X(), p.Y(), p.Z()) for p in corners])
                yield name, triangles
    say_loose(say, loose)


def say_loose(say, count):
    if count:
        say("ignored", "face", count, "it bounds no solid")


def write(target, found):
    """Writes every solid and returns their number."""
    count = 0
    with open(target, "w", encoding="utf-8") as out:
        for name, triangles in found:
            count += 1
            name = " ".join(name.split())
            out.write(f"solid {name}\n")
            for triangle in triangles:
                out.write("facet normal 0 0 0\nouter loop\n")
                for x, y, z in triangle:
                    out.write(f"vertex {x!r} {y!r} {z!r}\n")
                out.write("endloop\nendfacet\n")
            out.write("endsolid\n")
    return count


def main():
    module, source, target, segments = *sys.argv[1:4], int(sys.argv[4])
    lines = []

    def say(*columns):
        lines.append("\t".join(str(column) for column in columns))

    try:
        if module == "gmsh":
            import gmsh
            found = with_gmsh(gmsh, source, segments, say)
        else:
            import OCP  # noqa: F401
            found = with_open_cascade(source, segments, say)
    except (ImportError, OSError) as missing:
        print(missing)
        return 69
    count = write(target, found)
    with open(target + ".ledger", "w", encoding="utf-8") as out:
        out.write("\n".join(lines))
    if count == 0:
        print("; ".join(lines).replace("\t", " ") or "nothing that bounds a solid")
        return 70
    return 0


sys.exit(main())
