//! Directions to try from a pose.

use fft_correlate::Pose;
use glam::DVec3;

use crate::collision::checker::{CollisionChecker, Contact};
use crate::motion::vec6::{
    Mat6, Vec6, add_product, dot, eigenvectors, length, quadratic, scaled, solve,
};

/// Contacts closer than this share of the part's radius count.
const FAR: f64 = 0.1;
/// Normals closer than this (their cosine) count as one.
const SAME_NORMAL: f64 = 0.95;
/// Motions closer than this (their cosine) count as one.
const SAME_MOTION: f64 = 0.97;
/// Motions that contacts resist less than this share of all their resistance are soft.
const SOFT: f64 = 1e-3;
/// Most distinct normals of walls.
const NORMALS: usize = 5;

/// Unit motions to try: the last one first, then the translation along `exit`, then those that the walls
/// resist least, each in both senses. These are the softest directions of all contacts together (a screw
/// in a thread, a slide in a groove), translations along and across walls, and turns about the same axes.
pub(crate) fn candidates(
    checker: &CollisionChecker,
    pose: &Pose,
    level: f64,
    last: Option<Vec6>,
    exit: DVec3,
    contacts: &mut Vec<Contact>,
) -> Vec<Vec6> {
    let far = FAR * checker.frame.radius;
    checker.collect_contacts(pose, far, level + far, contacts);
    let stiffness = stiffness(contacts, far);
    let frame = &checker.frame;
    let mut found: Vec<Vec6> = eigenvectors(stiffness).to_vec();
    for axis in axes(checker, pose, contacts, far) {
        found.push(frame.motion(DVec3::ZERO, axis));
        found.push(frame.motion(axis / frame.radius, DVec3::ZERO));
    }
    let unit = |m: &Vec6| scaled(m, 1.0 / length(m).max(f64::MIN_POSITIVE));
    let mut both: Vec<Vec6> = found
        .iter()
        .flat_map(|m| [unit(m), scaled(&unit(m), -1.0)])
        .collect();
    both.sort_by(|a, b| quadratic(&stiffness, a).total_cmp(&quadratic(&stiffness, b)));
    let straight_out = frame.motion(DVec3::ZERO, exit);
    let mut kept: Vec<Vec6> = last.iter().map(unit).chain([straight_out]).collect();
    for motion in both {
        let same = |k: &Vec6| dot(k, &motion) > SAME_MOTION;
        if !kept.iter().any(same) {
            kept.push(motion);
        }
    }
    kept
}

/// The part of a motion that the walls resist little; none if they resist all of it.
pub(crate) fn compliant_direction(
    checker: &CollisionChecker,
    pose: &Pose,
    level: f64,
    motion: &Vec6,
    contacts: &mut Vec<Contact>,
) -> Option<Vec6> {
    let far = FAR * checker.frame.radius;
    checker.collect_contacts(pose, far, level + far, contacts);
    let mut stiffness = stiffness(contacts, far);
    let trace: f64 = (0..6).map(|i| stiffness[i][i]).sum();
    let soft = SOFT * trace;
    for (i, row) in stiffness.iter_mut().enumerate() {
        row[i] += soft;
    }
    let left = solve(stiffness, scaled(motion, soft))?;
    (length(&left) > 0.1 * length(motion)).then_some(left)
}

/// Stiffness of all contacts, nearer ones weighted more.
fn stiffness(contacts: &[Contact], far: f64) -> Mat6 {
    let mut m: Mat6 = [[0.0; 6]; 6];
    for c in contacts {
        add_product(&mut m, &c.slope, weight(c, far));
    }
    m
}

fn weight(contact: &Contact, far: f64) -> f64 {
    (1.0 - contact.distance.max(0.0) / far).max(0.0).powi(2)
}

/// Normals of the walls about a pose and the directions along two of them at once; where there are not
/// enough, the part's own axes.
fn axes(checker: &CollisionChecker, pose: &Pose, contacts: &[Contact], far: f64) -> Vec<DVec3> {
    // Cluster the contacts' normals into walls, weighted by nearness.
    let mut walls: Vec<(DVec3, f64)> = Vec::new();
    for c in contacts {
        let same = |w: &&mut (DVec3, f64)| w.0.normalize().dot(c.normal).abs() > SAME_NORMAL;
        let weight = weight(c, far);
        match walls.iter_mut().find(same) {
            Some(wall) => {
                wall.0 += weight * c.normal * wall.0.dot(c.normal).signum();
                wall.1 += weight;
            }
            None => walls.push(((weight + 1e-9) * c.normal, weight)),
        }
    }
    // Keep the nearest walls.
    walls.sort_by(|a, b| b.1.total_cmp(&a.1));
    let walls: Vec<DVec3> = walls
        .iter()
        .take(NORMALS)
        .map(|w| w.0.normalize())
        .collect();
    let mut axes: Vec<DVec3> = Vec::new();
    let mut add = |axis: DVec3| {
        if axis.length() > 0.2
            && !axes
                .iter()
                .any(|a| a.dot(axis.normalize()).abs() > SAME_NORMAL)
        {
            axes.push(axis.normalize());
        }
    };
    // Along two walls at once, across each, and the part's own axes.
    for (i, a) in walls.iter().enumerate() {
        for b in &walls[i + 1..] {
            add(a.cross(*b));
        }
    }
    walls.iter().for_each(|w| add(*w));
    for axis in principal_axes(checker) {
        add(pose.rotation * axis);
    }
    axes
}

/// Principal axes of the moving part's outermost vertices, in its own frame.
fn principal_axes(checker: &CollisionChecker) -> [DVec3; 3] {
    let mut m: Mat6 = [[0.0; 6]; 6];
    for q in &checker.frame.extremes {
        let d = *q - checker.frame.centre;
        add_product(&mut m, &[0.0, 0.0, 0.0, d.x, d.y, d.z], 1.0);
    }
    for (i, row) in m.iter_mut().enumerate().take(3) {
        row[i] = -1.0;
    }
    let vectors = eigenvectors(m);
    [3, 4, 5].map(|i| DVec3::new(vectors[i][3], vectors[i][4], vectors[i][5]))
}
