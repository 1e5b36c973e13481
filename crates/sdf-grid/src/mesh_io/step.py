# Turns a STEP file into an ASCII STL file in metres, one solid for each solid in it, under its
# name. Run by Pegfit:  python step.py IN.step OUT.stl SEGMENTS_PER_TURN
# Exits with 69 if neither Gmsh nor Open CASCADE can be imported.
import sys


def with_gmsh(gmsh, source, segments):
    """Yields (name, [triangle]) per solid, a triangle being three points."""
    gmsh.initialize(["gmsh", "-noenv"], interruptible=False)
    option = gmsh.option.setNumber
    option("General.Terminal", 0)
    option("General.AbortOnError", 2)
    gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    gmsh.open(source)
    option("Mesh.MeshSizeFromCurvature", segments)
    gmsh.model.mesh.generate(2)
    for dim, tag in gmsh.model.getEntities(3):
        triangles = []
        for _, face in gmsh.model.getBoundary([(dim, tag)], oriented=False):
            nodes, where, _ = gmsh.model.mesh.getNodes(2, face, includeBoundary=True)
            point = {n: [float(x) for x in where[3 * i:3 * i + 3]] for i, n in enumerate(nodes)}
            corners = gmsh.model.mesh.getElementsByType(2, face)[1]
            triangles += [
                [point[n] for n in corners[i:i + 3]] for i in range(0, len(corners), 3)
            ]
        yield gmsh.model.getEntityName(dim, tag).split("/")[-1], triangles


def with_open_cascade(source, segments):
    """The same with Open CASCADE alone (pip install cadquery-ocp)."""
    import math

    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_LabelSequence, TDF_Label
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document = TDocStd_Document(TCollection_ExtendedString("pegfit"))
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1.0)
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    if reader.ReadFile(source) != IFSelect_RetDone or not reader.Transfer(document):
        raise RuntimeError("not a STEP file")
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())

    def name_of(label):
        name = TDataStd_Name()
        found = label.FindAttribute(TDataStd_Name.GetID_s(), name)
        return name.Get().ToExtString() if found else ""

    def solids(label, location):
        referred = TDF_Label()
        if XCAFDoc_ShapeTool.GetReferredShape_s(label, referred):
            location = location * XCAFDoc_ShapeTool.GetLocation_s(label)
            yield from solids(referred, location)
            return
        parts = TDF_LabelSequence()
        if XCAFDoc_ShapeTool.GetComponents_s(label, parts):
            for i in range(1, parts.Length() + 1):
                yield from solids(parts.Value(i), location)
            return
        found = TopExp_Explorer(XCAFDoc_ShapeTool.GetShape_s(label), TopAbs_SOLID)
        while found.More():
            yield name_of(label), found.Current().Moved(location)
            found.Next()

    roots = TDF_LabelSequence()
    tool.GetFreeShapes(roots)
    for i in range(1, roots.Length() + 1):
        for name, solid in solids(roots.Value(i), TopLoc_Location()):
            BRepMesh_IncrementalMesh(solid, 1e-3, True, 2 * math.pi / segments)
            triangles = []
            faces = TopExp_Explorer(solid, TopAbs_FACE)
            while faces.More():
                at = TopLoc_Location()
                mesh = BRep_Tool.Triangulation_s(TopoDS.Face_s(faces.Current()), at)
                for k in range(1, mesh.NbTriangles() + 1 if mesh else 1):
                    corners = (mesh.Node(n).Transformed(at.Transformation())
                               for n in mesh.Triangle(k).Get())
                    triangles.append([(p.X(), p.Y(), p.Z()) for p in corners])
                faces.Next()
            yield name, triangles


def main():
    source, target, segments = sys.argv[1], sys.argv[2], int(sys.argv[3])
    try:
        import gmsh
        found = with_gmsh(gmsh, source, segments)
    except (ImportError, OSError) as missing:
        try:
            import OCP  # noqa: F401
        except (ImportError, OSError):
            print(missing)
            return 69
        found = with_open_cascade(source, segments)
    with open(target, "w", encoding="utf-8") as out:
        for name, triangles in found:
            name = " ".join(name.split())
            out.write(f"solid {name}\n")
            for triangle in triangles:
                out.write("facet normal 0 0 0\nouter loop\n")
                for x, y, z in triangle:
                    out.write(f"vertex {x!r} {y!r} {z!r}\n")
                out.write("endloop\nendfacet\n")
            out.write("endsolid\n")
    return 0


sys.exit(main())
