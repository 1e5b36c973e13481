//! XML with indented elements.

use fft_correlate::Pose;
use glam::DVec3;
use quick_xml::escape::escape;

/// An element, or a comment.
pub(super) enum Node {
    Element(Element),
    Comment(String),
}

/// An element with attributes and what it holds.
pub(super) struct Element {
    name: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Node>,
}

impl Element {
    pub(super) fn new(name: &'static str) -> Self {
        Self {
            name,
            attributes: Vec::new(),
            children: Vec::new(),
        }
    }

    /// With an attribute.
    pub(super) fn with(mut self, key: &'static str, value: impl Into<String>) -> Self {
        self.attributes.push((key, value.into()));
        self
    }

    /// With an attribute of numbers.
    pub(super) fn numbers(self, key: &'static str, values: &[f64]) -> Self {
        let text: Vec<String> = values.iter().map(|v| number(*v)).collect();
        self.with(key, text.join(" "))
    }

    /// With a vector.
    pub(super) fn vector(self, key: &'static str, value: DVec3) -> Self {
        self.numbers(key, &value.to_array().map(cleared))
    }

    /// With an element in it.
    pub(super) fn child(mut self, child: Self) -> Self {
        self.children.push(Node::Element(child));
        self
    }

    /// With elements in it.
    pub(super) fn children(mut self, children: impl IntoIterator<Item = Self>) -> Self {
        self.children
            .extend(children.into_iter().map(Node::Element));
        self
    }

    /// With a comment in it.
    pub(super) fn comment(mut self, text: impl Into<String>) -> Self {
        self.children.push(Node::Comment(text.into()));
        self
    }

    /// A whole file.
    pub(super) fn document(&self) -> String {
        let mut text = "<?xml version=\"1.0\"?>\n".to_owned();
        self.write(0, &mut text);
        text
    }

    fn write(&self, depth: usize, text: &mut String) {
        let indent = "  ".repeat(depth);
        *text += &format!("{indent}<{}", self.name);
        for (key, value) in &self.attributes {
            *text += &format!(" {key}=\"{}\"", escape(value.as_str()));
        }
        if self.children.is_empty() {
            *text += "/>\n";
            return;
        }
        *text += ">\n";
        for child in &self.children {
            match child {
                Node::Element(element) => element.write(depth + 1, text),
                // Two hyphens end a comment.
                Node::Comment(comment) => {
                    *text += &format!("{indent}  <!-- {} -->\n", comment.replace("--", "- -"));
                }
            }
        }
        *text += &format!("{indent}</{}>\n", self.name);
    }
}

/// A number that reads back as the same, without a minus before zero.
pub(super) fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

/// Zero in the place of what rounding leaves of metres and directions.
fn cleared(value: f64) -> f64 {
    if value.abs() < 1e-15 { 0.0 } else { value }
}

/// `w x y z` of a pose, as MJCF has quaternions.
pub(super) fn quaternion(pose: &Pose) -> [f64; 4] {
    let [x, y, z, w] = pose.rotation.to_array();
    [w, x, y, z].map(cleared)
}

/// Roll, pitch and yaw of a pose, as URDF has rotations: about the fixed x axis, then y, then z.
pub(super) fn roll_pitch_yaw(pose: &Pose) -> [f64; 3] {
    let m = glam::DMat3::from_quat(pose.rotation);
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let yaw = x.y.atan2(x.x);
    let pitch = (-x.z).atan2(x.x.hypot(x.y));
    // From what is left after yaw, so that it is exact where pitch is a right angle.
    let (sine, cosine) = yaw.sin_cos();
    let roll = (sine * z.x - cosine * z.y).atan2(cosine * y.y - sine * y.x);
    [roll, pitch, yaw].map(cleared)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn roll_pitch_and_yaw_give_the_rotation_back_at_right_angles_too() {
        let quarter = std::f64::consts::FRAC_PI_2;
        for (axis, angle) in [
            (DVec3::Y, quarter),
            (DVec3::Y, -quarter),
            (DVec3::new(1.0, 2.0, -0.5), 2.3),
            (DVec3::X, std::f64::consts::PI),
            (DVec3::new(1.0, 1.0, 1.0), 2.0 * std::f64::consts::FRAC_PI_3),
            (DVec3::new(0.0, 1.0, 1e-5), quarter),
        ] {
            let rotation = DQuat::from_axis_angle(axis.normalize(), angle);
            let pose = Pose::new(rotation, DVec3::ZERO);
            let [r, p, y] = roll_pitch_yaw(&pose);
            let back =
                DQuat::from_rotation_z(y) * DQuat::from_rotation_y(p) * DQuat::from_rotation_x(r);
            assert!(back.dot(rotation).abs() > 1.0 - 1e-14, "{axis} {angle}");
        }
    }

    #[test]
    fn attributes_and_comments_are_escaped() {
        let text = Element::new("a")
            .with("name", "x<\"&'>y")
            .comment("-- >")
            .document();
        assert!(
            text.contains("name=\"x&lt;&quot;&amp;&apos;&gt;y\""),
            "{text}"
        );
        assert!(text.contains("<!-- - - > -->"), "{text}");
    }
}
