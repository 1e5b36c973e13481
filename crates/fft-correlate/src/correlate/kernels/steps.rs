//! Which passes make a transform of one length.

/// What is known of both ends of a transform, and how its passes must begin and end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Ends {
    /// The second half of the input is zero and not read.
    pub(crate) from_half: bool,
    /// The second half of the output is not wanted and not written.
    pub(crate) to_half: bool,
    /// The radix of the first pass, and of the last.
    pub(crate) first: Option<usize>,
    pub(crate) last: Option<usize>,
}

/// One pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Step {
    pub(crate) radix: usize,
    /// Half of the inputs (of a first pass) or of the outputs (of a last one) are left out.
    pub(crate) half: bool,
}

/// Radices of the passes with their cost per element, compared with radix 2; then of those that
/// leave out half of their inputs or outputs.
const WHOLE: [(usize, f64); 5] = [(8, 1.9), (4, 1.3), (5, 1.75), (3, 1.25), (2, 1.0)];
const HALF: [(usize, f64); 2] = [(16, 2.1), (8, 1.5)];

/// Cost of a pass that only copies: at an end whose pass does not read or write by itself.
const COPY: f64 = 0.9;

impl Step {
    /// Whether the pass reads the input, or writes the result, by itself.
    pub(crate) fn streams(self) -> bool {
        self.half || matches!(self.radix, 4 | 8)
    }

    fn cost(self) -> f64 {
        let known: &[_] = if self.half { &HALF } else { &WHOLE };
        let found = known.iter().find(|r| r.0 == self.radix);
        found.map_or(0.0, |r| r.1)
    }
}

/// The cheapest passes for a transform; `None` if `len` is zero, has a prime factor above 5, or no
/// passes end as asked.
pub(crate) fn steps(len: usize, ends: Ends) -> Option<Vec<Step>> {
    let mut best: Option<(f64, Vec<Step>)> = None;
    let mut offer = |steps: Vec<Step>| {
        let cost = cost(&steps);
        if best.as_ref().is_none_or(|b| cost < b.0) {
            best = Some((cost, steps));
        }
    };
    let whole = |radix| Step { radix, half: false };
    if len == 1
        && [ends.first, ends.last]
            .iter()
            .all(|r| r.is_none_or(|r| r == 1))
    {
        offer(Vec::new());
    }
    for first in candidates(len, ends.first, ends.from_half) {
        let rest = len / first.radix;
        if rest == 1 && !first.half && ends.last.is_none_or(|r| r == len) {
            offer(vec![first]);
        }
        for last in candidates(rest, ends.last, ends.to_half) {
            if let Some(middle) = middle(rest / last.radix) {
                let middle = middle.into_iter().map(whole);
                offer([first].into_iter().chain(middle).chain([last]).collect());
            }
        }
    }
    best.map(|b| b.1)
}

/// Whether a transform of this length has passes at all.
pub(crate) fn known(len: usize) -> bool {
    steps(len, Ends::default()).is_some()
}

/// Passes there and back such that the last radix there is the first one back: with two transforms
/// there for each one back, the cheapest.
pub(crate) fn turning_steps(len: usize, from_half: bool, to_half: bool) -> Option<[Vec<Step>; 2]> {
    let pair = |radix: usize| {
        let there = Ends {
            from_half,
            last: Some(radix),
            ..Ends::default()
        };
        let back = Ends {
            to_half,
            first: Some(radix),
            ..Ends::default()
        };
        Some([steps(len, there)?, steps(len, back)?])
    };
    [1, 2, 3, 4, 5, 8]
        .into_iter()
        .filter_map(pair)
        .min_by(|[a, b], [c, d]| {
            let cost = |there: &[Step], back: &[Step]| 2.0 * cost(there) + cost(back);
            cost(a, b).total_cmp(&cost(c, d))
        })
}

/// Passes that a transform of `len` points may begin or end with.
fn candidates(len: usize, asked: Option<usize>, half: bool) -> impl Iterator<Item = Step> {
    let halves = HALF.iter().filter(move |_| half && asked.is_none());
    let halves = halves.map(|(radix, _)| Step {
        radix: *radix,
        half: true,
    });
    let whole = WHOLE.iter().map(|(radix, _)| Step {
        radix: *radix,
        half: false,
    });
    let whole = whole.filter(move |s| asked.is_none_or(|r| r == s.radix));
    halves
        .chain(whole)
        .filter(move |s| len > 0 && len.is_multiple_of(s.radix))
}

/// Radices of product `len`, large ones first.
fn middle(len: usize) -> Option<Vec<usize>> {
    let mut rest = len;
    let mut radices = Vec::new();
    for radix in [8, 4, 2, 5, 3] {
        while rest > 0 && rest.is_multiple_of(radix) {
            rest /= radix;
            radices.push(radix);
        }
    }
    (rest == 1).then_some(radices)
}

/// Cost per element, compared with a pass of radix 2.
pub(crate) fn cost(steps: &[Step]) -> f64 {
    let copies = match steps {
        [] => 2,
        [_] => 1,
        [first, .., last] => usize::from(!first.streams()) + usize::from(!last.streams()),
    };
    steps.iter().map(|s| s.cost()).sum::<f64>() + COPY * copies as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(steps: &[Step]) -> usize {
        steps.iter().map(|s| s.radix).product()
    }

    #[test]
    fn radices_multiply_to_the_length_or_there_are_none() {
        for len in 1..2000 {
            match steps(len, Ends::default()) {
                Some(s) => assert_eq!(product(&s), len),
                None => assert!((7..=len).any(|p| len % p == 0 && p % 2 * (p % 3) * (p % 5) > 0)),
            }
            for (from_half, to_half) in [(false, false), (true, false), (false, true), (true, true)]
            {
                let Some([there, back]) = turning_steps(len, from_half, to_half) else {
                    assert!(!known(len), "{len}");
                    continue;
                };
                assert_eq!((product(&there), product(&back)), (len, len));
                let turn = |s: Option<&Step>| s.map_or(1, |s| s.radix);
                assert_eq!(turn(there.last()), turn(back.first()), "{len}");
                // Only the outer ends may leave out halves.
                assert!(
                    there.iter().skip(1).all(|s| !s.half)
                        && (from_half || !there[..1.min(there.len())].iter().any(|s| s.half))
                );
                assert!(
                    back.iter().rev().skip(1).all(|s| !s.half)
                        && (to_half || back.last().is_none_or(|s| !s.half))
                );
            }
        }
        assert!(!known(0));
    }

    #[test]
    fn halves_are_left_out_where_that_saves_a_pass() {
        let radices = |len, from_half| -> Vec<usize> {
            let ends = Ends {
                from_half,
                ..Ends::default()
            };
            let steps = steps(len, ends).unwrap();
            steps.iter().map(|s| s.radix).collect()
        };
        assert_eq!(radices(128, true), [16, 8]);
        assert_eq!(radices(128, false).len(), 3);
        assert_eq!(radices(64, false), [8, 8]);
    }
}
