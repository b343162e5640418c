"""What differs between Storm and the loader and stays so, with its reason: seen in pictures of the differences."""

REASONS = (
    "**displayOpacity without a material** (torus_knots, curtains, brickadia_house, wireframe_opacity.usda): with one "
    "sample a pixel Storm draws such surfaces opaque. The loader takes their opacity.",
    "**No colour**: the loader's grey is .7, Storm's .5. Pixels that show one such surface are explained; those that "
    "show it through others are not (testPreviewSurfaceTranslucent.usda).",
    "**MaterialX** (chess_set, intent_vfx_teapots): Storm shows its grey, opaque: its wheel reads no such materials.",
    "**Surfaces in one plane** (engine): the transparent bottom of the sump lies in the opaque stand: either wins.",
    "**Textures without texture coordinates** (mini_car_kit): (0, 0) is the corner of a texture that is black outside, "
    "of which Storm shows a quarter, filtered, and the loader the texel.",
    "**Two of three point instancers** (arnold_point_instancer): those with `int primvars:arnold:deform_keys`, one "
    "value for all instances, are drawn by Storm as one instance. The schema has no such rule; all 1,000 are loaded.",
    "**arnold_nested_instances** through its camera: 750 pixels of instances that are a few pixels wide. They are not "
    "explained; from the other views the same geometry agrees.",
    "**Round gprims** (usdwg_schema_tests, openusd_opacity): Storm draws spheres, cylinders, cones and capsules with "
    "ten sides, the loader with 32; USD leaves that to the renderer.",
    "**Refined quads that are not flat** (usdwg_schema_tests, samples): their corners are equal, and Storm cuts them "
    "along the other diagonal. Which one is no part of a subdivision's definition.",
    "**Vertex colours of a Cube** (wireframe_opacity.usda): USD does not say in which order its corners are.",
    "**pointsTypes.usda**: points of types that the schema does not have; Storm leaves four of the meshes out, the "
    "loader converts the numbers.",
    "**weird_matrix_transform.usda**: a matrix whose last column is not (0, 0, 0, 1). Storm divides by it, the loader "
    "reads the affine part.",
    "**Models' draw modes** (teapot) are switched off in Storm: the loader reads none, and draws the geometry.",
    "**A few pixels** of colour (voxel_town, hair_cards, smoke_cards) or at edges (AlphaBlendModeTest, "
    "AlphaBlendSortTest): textures that are seen small, and surfaces thinner than a pixel.",
)

PICTURES = {
    "torus_knots": "torus_knots as authored: opacities without a material",
    "quads": "quads.usda, refined: another diagonal",
    "arnold_point_instancer": "arnold_point_instancer: two instancers of which Storm draws one instance each",
    "engine": "engine as authored: the sump's bottom in the plane of the stand",
}
"""Files in `results/loader`, and what they show."""
