//! Shrinks a failing spec: parts are left out, and the rest is completed again.

use super::draft::{Draft, Frame, Placement};
use super::{Sample, complete};

/// Leaves out parts of a draft as long as the rest still fails; the loops are closed anew each
/// time.
///
/// ```
/// use regen_tests::random;
///
/// let sample = (0..).find_map(|s| random::sample(s).sample.filter(|s| s.draft.cuts.len() > 1));
/// let small = random::shrink(sample.unwrap(), &|s| !s.draft.cuts.is_empty());
/// assert_eq!(small.draft.cuts.len(), 1);
/// ```
pub fn shrink(sample: Sample, fails: &dyn Fn(&Sample) -> bool) -> Sample {
    let mut smallest = sample;
    // Each round leaves out one part, so as many rounds as parts are enough.
    'rounds: for _ in 0..200 {
        for draft in smaller(&smallest.draft) {
            if let Ok(candidate) = complete(&draft)
                && fails(&candidate)
            {
                smallest = candidate;
                continue 'rounds;
            }
        }
        break;
    }
    smallest
}

/// All drafts with one part less, large parts first. A draft that refers to a removed part is not a
/// spec, and is skipped by the caller.
fn smaller(draft: &Draft) -> Vec<Draft> {
    let mut out = Vec::new();
    let mut with = |change: &dyn Fn(&mut Draft)| {
        let mut less = draft.clone();
        change(&mut less);
        if less != *draft {
            out.push(less);
        }
    };
    for limb in 0..draft.limbs.len() {
        // Without the limb, and without all cuts and limbs on its bodies.
        with(&|d| {
            let removed = d.limbs.remove(limb);
            let on = |body: Option<&String>| {
                let carried = removed.joints.iter().any(|j| j.body.as_ref() == body);
                body.is_some() && carried
            };
            d.cuts
                .retain(|c| !on(c.a.body.as_ref()) && !on(c.b.as_ref()));
            d.limbs.retain(|l| !on(l.from.as_ref()));
            d.couplings.clear();
        });
    }
    for cut in 0..draft.cuts.len() {
        with(&|d| drop(d.cuts.remove(cut)));
    }
    with(&|d| d.couplings.clear());
    for limb in 0..draft.limbs.len() {
        for joint in 0..draft.limbs[limb].joints.len() {
            with(&|d| {
                if d.limbs[limb].joints.len() > 1 {
                    d.limbs[limb].joints.remove(joint);
                }
            });
            with(&|d| {
                let joint = &mut d.limbs[limb].joints[joint];
                (joint.friction, joint.rotor) = ("none", false);
                joint.more.clear();
            });
            with(&|d| d.limbs[limb].joints[joint].frame = Frame::Same);
            with(&|d| {
                for home in &mut d.limbs[limb].joints[joint].home {
                    *home = "0".into();
                }
            });
        }
        with(&|d| d.limbs[limb].base = Placement::none());
        with(&|d| d.limbs[limb].from = None);
    }
    for cut in 0..draft.cuts.len() {
        with(&|d| d.cuts[cut].displacement = [0.0; 4]);
        with(&|d| d.cuts[cut].a.placement = Placement::none());
    }
    with(&|d| d.off_home = 0.0);
    with(&|d| d.gravity = None);
    out
}
