"""What differs between Storm and the loader and stays so, with its reason: seen in pictures of the differences."""

REASONS = (
    "**Round gprims** (usdwg_schema_tests, openusd_opacity): Storm draws spheres, cylinders, cones and capsules with "
    "ten sides, the loader with 32; USD leaves that to the renderer.",
    "**Refined quads that are not flat** (usdwg_schema_tests): their corners are equal, and Storm cuts them along the "
    "other diagonal. Which one is no part of a subdivision's definition.",
    "**pointsTypes.usda**: points of types that the schema does not have, such as `double3[]`; Storm leaves such "
    "meshes out, the loader converts the numbers.",
    "**weird_matrix_transform.usda**: a matrix whose last column is not (0, 0, 0, 1). Storm divides by it, the loader "
    "reads the affine part.",
    "**displayOpacity without a material** (torus_knots, brickadia_house, wireframe_opacity.usda): Storm has no place for "
    "such surfaces in its lists, and draws them opaque where a pixel has one sample. The loader takes their opacity.",
    "**Texels** (voxel_town and others with a few pixels of colour): textures that are seen small, between two levels of "
    "their mip maps.",
    "**No colour seen through glass** (testPreviewSurfaceTranslucent.usda): each renderer's own grey, behind others.",
    "**Vertex colours of a Cube** (wireframe_opacity.usda): USD does not say in which order the corners of a Cube are.",
)
