//! URDF, the robots of ROS.

mod known;
mod mesh_file;
mod places;
pub(crate) mod read;
