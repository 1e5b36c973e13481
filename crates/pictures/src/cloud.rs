//! Points in space, seen from above one corner, with the edges of the part around them.

use glam::{DMat3, DVec2, DVec3};
use plotters::prelude::*;

use crate::canvas::{Drawing, Panel, stroke};
use crate::colour::ColourScale;
use crate::heat_map::{draw_legend, legend_frame};
use crate::rules::{GRID, INK, centred, text_size};

/// Points with values, and lines for orientation. Positions are in the unit of the picture.
#[derive(Debug, Clone)]
pub struct Cloud {
    /// Above the picture.
    pub title: String,
    /// Where the points are.
    pub points: Vec<DVec3>,
    /// Their values.
    pub values: Vec<f64>,
    /// Width of a point.
    pub width: f64,
    /// Edges of the part.
    pub edges: Vec<[DVec3; 2]>,
    /// From values to colours.
    pub scale: ColourScale,
    /// Beside the legend, with its unit.
    pub legend: String,
    /// Name of the unit of lengths.
    pub unit: String,
    /// At the foot of the picture.
    pub note: String,
}

/// How far the view is turned about z and tilted down, radians.
const VIEW: (f64, f64) = (0.55, 0.5);

impl Cloud {
    /// Draws the cloud into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw(&self, panel: &Panel<'_>) -> Drawing {
        let size = text_size(panel);
        let (scene, bar) = legend_frame(panel, &self.title, &self.note)?;
        let view = View::from_cloud(self, scene.dim_in_pixel(), size);
        self.draw_edges(&scene, &view)?;
        self.draw_points(&scene, &view)?;
        view.draw_axes(&scene, &self.unit, size)?;
        draw_legend(&bar, &self.scale, &self.legend, size)
    }

    fn draw_edges(&self, scene: &Panel<'_>, view: &View) -> Drawing {
        for edge in &self.edges {
            let line = edge.map(|p| view.pixel(p)).to_vec();
            let style = INK.mix(0.45).stroke_width(stroke(1));
            scene.draw(&PathElement::new(line, style))?;
        }
        Ok(())
    }

    /// Far points first, paler the farther they are.
    fn draw_points(&self, scene: &Panel<'_>, view: &View) -> Drawing {
        let depth = |p: &DVec3| view.seen(*p).y;
        let depths: Vec<f64> = self.points.iter().map(depth).collect();
        let (near, far) = depths
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), d| {
                (a.min(*d), b.max(*d))
            });
        let mut order: Vec<usize> = (0..self.points.len()).collect();
        order.sort_by(|&a, &b| depths[b].total_cmp(&depths[a]));
        let radius = (0.4 * self.width * view.zoom).ceil().max(2.0) as i32;
        for i in order {
            let share = (depths[i] - near) / (far - near).max(f64::MIN_POSITIVE);
            let solid = 1.0 - 0.55 * share;
            let colour = self.scale.colour(self.values[i]);
            let pale = |c: u8| (255.0 - solid * (255.0 - f64::from(c))) as u8;
            let colour = RGBColor(pale(colour.0), pale(colour.1), pale(colour.2));
            let dot = Circle::new(view.pixel(self.points[i]), radius, colour.filled());
            scene.draw(&dot)?;
        }
        Ok(())
    }
}

/// A parallel projection onto the panel.
struct View {
    turn: DMat3,
    /// Pixels per unit.
    zoom: f64,
    /// Pixel of the middle of what is shown.
    middle: DVec2,
    /// The middle of what is shown, turned.
    center: DVec3,
    /// Corners of the box around the edges.
    bounds: [DVec3; 2],
}

impl View {
    fn from_cloud(cloud: &Cloud, (width, height): (u32, u32), size: u32) -> Self {
        // Rows: right in the picture, into it, up.
        let turn = DMat3::from_rotation_x(VIEW.1) * DMat3::from_rotation_z(VIEW.0);
        let around = |points: &mut dyn Iterator<Item = DVec3>| {
            points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[lo, hi], p| {
                [lo.min(p), hi.max(p)]
            })
        };
        let ends = || cloud.edges.iter().flatten().copied();
        let all = || ends().chain(cloud.points.iter().copied());
        let [low, high] = around(&mut all().map(|p| turn * p));
        // A ball has no edges.
        let bounds = match cloud.edges.is_empty() {
            true => around(&mut all()),
            false => around(&mut ends()),
        };
        let sheet = DVec2::new(f64::from(width), f64::from(height));
        // Labels stand to the left of the part and below it.
        let room = sheet - f64::from(size) * DVec2::new(10.0, 5.0);
        let extent = (high - low).max(DVec3::splat(f64::MIN_POSITIVE));
        Self {
            turn,
            zoom: (room.x / extent.x).min(room.y / extent.z),
            middle: 0.5 * sheet + f64::from(size) * DVec2::new(2.0, 0.0),
            center: 0.5 * (low + high),
            bounds,
        }
    }

    fn seen(&self, p: DVec3) -> DVec3 {
        self.turn * p - self.center
    }

    fn pixel(&self, p: DVec3) -> (i32, i32) {
        let q = self.seen(p);
        let x = self.middle.x + self.zoom * q.x;
        let y = self.middle.y - self.zoom * q.z;
        (x as i32, y as i32)
    }

    /// Three edges of the box at the rim of the picture, each named with its length.
    fn draw_axes(&self, scene: &Panel<'_>, unit: &str, size: u32) -> Drawing {
        let [low, high] = self.bounds;
        let side = high - low;
        let corner = |x, y, z| DVec3::new(x, y, z);
        let size = size as i32;
        let axes = [
            ("x", low, corner(high.x, low.y, low.z), (size, 5 * size / 4)),
            ("y", low, corner(low.x, high.y, low.z), (-3 * size, size)),
            (
                "z",
                corner(low.x, high.y, low.z),
                corner(low.x, high.y, high.z),
                (-4 * size, 0),
            ),
        ];
        for (axis, (name, from, to, away)) in axes.into_iter().enumerate() {
            let line = vec![self.pixel(from), self.pixel(to)];
            scene.draw(&PathElement::new(line, GRID.stroke_width(stroke(2))))?;
            let (x, y) = self.pixel(0.5 * (from + to));
            let length = crate::number::number(side[axis], 3);
            let label = format!("{name}: {length} {unit}");
            scene.draw_text(&label, &centred(size as u32, INK), (x + away.0, y + away.1))?;
        }
        Ok(())
    }
}
