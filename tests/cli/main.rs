//! The program as its users meet it: every test starts it.

#[path = "../common/cli_support.rs"]
mod cli_support;
#[path = "../common/data.rs"]
mod data;
#[allow(dead_code, unreachable_pub)]
#[path = "../common/raster_support/tiff_builder.rs"]
mod tiff_builder;

mod bad_clouds;
mod bad_input;
mod cloud;
mod cloud_order;
mod color_relief;
mod contour;
mod crs_matrix;
mod demo_methods;
mod geoids;
mod grid;
mod grid_attributes;
mod help;
mod info_features;
mod info_quality;
mod jobs;
mod line;
mod line_hierarchy;
mod manners;
mod many;
mod mosaic;
mod parts;
mod pipes;
mod plan_cloud;
mod plan_grid;
mod plan_matrix;
mod points;
mod points_inputs;
mod print;
mod relief;
mod resume;
mod serve;
mod shapes;
mod synth;
mod tiles;
mod tiles_broken;
mod tiles_cloud;
mod tiles_meshopt;
mod tiles_skirts;
mod tiles_systems;
mod tiles_three;
mod tiles_water;
mod tin_angle;
mod tin_bands;
mod tin_breaklines;
mod tin_clip;
mod tin_cloud_lines;
mod tin_data_dependent;
mod tin_fit;
mod tin_keep;
mod tin_limits;
mod tin_methods;
mod transform;
mod view_cloud;
mod view_page;
mod warp;
mod water;
