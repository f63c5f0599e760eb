//! Specs of platforms on any number of UPS legs, to measure how cost grows with the mechanism.

use std::fmt::Write as _;

/// Radii of the circles of the anchors on the ground and on the platform, m. The anchors are
/// rotated alternately by plus and minus `TURNED`, rad, which makes pairs; the platform is
/// `HEIGHT`, m, above the ground.
const RADIUS: [f64; 2] = [0.5, 0.28];
const TURNED: f64 = 0.3;
const HEIGHT: f64 = 0.6;

/// The spec of a level platform on `legs` legs, each of a universal, an actuated prismatic and a
/// spherical joint, cut at the spherical joints of all but the first leg. Six coordinates are
/// independent: the lengths of up to six legs, then, for fewer than six legs, coordinates of the
/// first leg.
///
/// ```
/// use regen_tests::platform;
/// use regen_tests::reference::Mechanism;
///
/// let hexapod = Mechanism::from_yaml(&platform::ups(6))?;
/// let home = hexapod.home()?;
/// assert_eq!(hexapod.mobility(&home), 6);
/// # Ok::<(), String>(())
/// ```
pub fn ups(legs: usize) -> String {
    let mut limbs = String::new();
    let mut cuts = String::new();
    let mut home = Vec::new();
    let anchor = |leg: usize, on: usize| {
        let sign = if (leg + on).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let angle = std::f64::consts::TAU * leg as f64 / legs as f64 + sign * TURNED;
        [RADIUS[on] * angle.cos(), RADIUS[on] * angle.sin()]
    };
    for leg in 0..legs {
        let (ground, platform) = (anchor(leg, 0), anchor(leg, 1));
        let n = leg + 1;
        let _ = write!(
            limbs,
            "  - name: leg{n}\n    base: {{xyz: [{:.6}, {:.6}, 0]}}\n    joints:\n      \
             - {{name: u{n}, type: universal, body: low{n}}}\n      \
             - {{name: p{n}, type: prismatic, body: high{n}, actuated: true}}\n",
            ground[0], ground[1]
        );
        let along = [platform[0] - ground[0], platform[1] - ground[1], HEIGHT];
        let length = along.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (x, y) = ((-along[1]).atan2(along[2]), (along[0] / length).asin());
        home.push(format!("u{n}.1: {x:.6}, u{n}.2: {y:.6}, p{n}: {length:.6}"));
        if leg == 0 {
            home.push(format!("s1.2: {:.6}, s1.3: {:.6}", -y, -x));
            let _ = write!(
                limbs,
                "      - {{name: s1, type: spherical}}\n      - {{name: centre, type: fixed, \
                 origin: {{xyz: [{:.6}, {:.6}, 0]}}, body: platform}}\n",
                -platform[0], -platform[1]
            );
        } else {
            let _ = writeln!(
                cuts,
                "  - {{name: s{n}, joint: spherical, between: [{{body: platform, xyz: [{:.6}, \
                 {:.6}, 0]}}, {{body: high{n}}}]}}",
                platform[0], platform[1]
            );
        }
    }
    let lengths = (1..=legs.min(6)).map(|n| format!("p{n}"));
    let rest = ["u1.1", "u1.2", "s1.1"].map(String::from);
    let independent: Vec<String> = lengths.chain(rest).take(6).collect();
    format!(
        "name: ups{legs}\nlimbs:\n{limbs}cuts:\n{cuts}independent: [{}]\nhome: {{{}}}\n",
        independent.join(", "),
        home.join(", ")
    )
}
