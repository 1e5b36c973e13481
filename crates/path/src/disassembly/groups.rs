//! Which parts are tried together.

/// Sets of `size` of the parts `set`, those without its first one first. Of two sets that are all that
/// there is, only one is given: what moves against what does not matter.
pub(super) fn groups(set: &[usize], size: usize) -> Vec<Vec<usize>> {
    let Some((base, others)) = set.split_first() else {
        return Vec::new();
    };
    let mut all = choices(others, size);
    if 2 * size < set.len() && size > 0 {
        let with_base = choices(others, size - 1).into_iter();
        all.extend(with_base.map(|more| [&[*base][..], &more].concat()));
    }
    all
}

/// All ways to choose `size` of some parts, in their order.
fn choices(of: &[usize], size: usize) -> Vec<Vec<usize>> {
    if size == 0 {
        return vec![Vec::new()];
    }
    let with = |i: usize| {
        let rest = choices(&of[i + 1..], size - 1).into_iter();
        rest.map(move |more| [&[of[i]][..], &more].concat())
    };
    (0..of.len()).flat_map(with).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_division_in_two_is_tried_once_the_first_part_last() {
        for count in 2..=7usize {
            let set: Vec<usize> = (10..10 + count).collect();
            let all: Vec<Vec<usize>> = (1..=count / 2).flat_map(|k| groups(&set, k)).collect();
            assert_eq!(all.len(), (1 << (count - 1)) - 1);
            for (i, group) in all.iter().enumerate() {
                let rest: Vec<usize> = set.iter().copied().filter(|p| !group.contains(p)).collect();
                assert!(!all[..i].contains(group) && !all.contains(&rest));
            }
            assert_eq!(all[0], [11]);
        }
        assert_eq!(groups(&[3, 5, 7], 1), [vec![5], vec![7], vec![3]]);
        assert!(groups(&[], 1).is_empty());
    }
}
