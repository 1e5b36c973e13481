// What the program `gmsh` makes of the STEP file that it has opened: triangles of the faces that
// bound solids. A line before sets Segments.
Solids() = Volume{:};
If(#Solids() == 0)
  Printf("pegfit: no solid in the file");
  Exit;
EndIf
Corners() = BoundingBox Volume{ Solids() };
Diagonal = Sqrt((Corners(3) - Corners(0))^2 + (Corners(4) - Corners(1))^2
                + (Corners(5) - Corners(2))^2);
// Shorter edges would cut tips of cones and slivers of faces without end.
Mesh.MeshSizeMin = 1e-3 * Diagonal;
Mesh.MeshSizeFromCurvature = Segments;
// Of solids only: faces that bound none are left out.
Physical Surface(1) = Unique(Abs(Boundary{ Volume{:}; }));
