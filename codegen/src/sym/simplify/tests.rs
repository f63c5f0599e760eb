use super::*;
use crate::sym::print::text;

/// For each rule, an expression that it applies to and the text of the result.
#[test]
fn the_named_rules_rewrite_start_to_goal() {
    let mut g = Graph::new();
    let [x, y, p] = ["x", "y", "p"].map(|n| g.symbol(n));
    let angle_a = g.coordinate_angle("a", &Number::zero());
    let angle_b = g.coordinate_angle("b", &Number::zero());
    let (sa, ca) = g.sin_cos(&angle_a);
    let (sb, cb) = g.sin_cos(&angle_b);
    let two = g.integer(2);
    let three = g.integer(3);

    let check = |g: &Graph, ex: Ex, goal: &str| assert_eq!(text(g, ex), goal);

    // constants come first
    let l = g.mul(two, x);
    let r = g.mul(y, three);
    let e = g.mul(l, r);
    check(&g, e, "6*x*y");
    // signs move outward, and opposite differences share a node
    let d = g.sub(y, x);
    check(&g, d, "y - x");
    let opposite = g.sub(x, y);
    assert_eq!(g.node(d), Node::Neg(opposite));
    let nx = g.neg(x);
    let e = g.mul(nx, y);
    check(&g, e, "-x*y");
    // like terms collect
    let s = g.add(x, y);
    let e = g.sub(s, x);
    check(&g, e, "y");
    // also if a product was built in another order
    let xy = g.mul(x, y);
    let l = g.mul(xy, p);
    let yp = g.mul(y, p);
    let r = g.mul(x, yp);
    let e = g.sub(l, r);
    check(&g, e, "0");
    let tx = g.mul(two, x);
    let e = g.sub(tx, x);
    check(&g, e, "x");
    // squares of one angle, with a common factor
    let ps = g.mul(p, sa);
    let pss = g.mul(ps, sa);
    let pc = g.mul(p, ca);
    let pcc = g.mul(ca, pc);
    let e = g.add(pss, pcc);
    check(&g, e, "p");
    let e = g.sub(p, pss);
    check(&g, e, "p*cos(a)^2");
    // angles about parallel axes
    let cc = g.mul(pc, cb);
    let ss = g.mul(ps, sb);
    let e = g.sub(cc, ss);
    check(&g, e, "p*cos(a + b)");
    let e = g.sub(ss, cc);
    check(&g, e, "-p*cos(a + b)");
    let e = g.add(cc, ss);
    check(&g, e, "p*cos(a - b)");
    let sc = g.mul(sa, cb);
    let cs = g.mul(ca, sb);
    let e = g.add(sc, cs);
    check(&g, e, "sin(a + b)");
    let e = g.sub(cs, sc);
    check(&g, e, "-sin(a - b)");
    // x * (1/x)
    let inv = g.div(Ex::ONE, x).unwrap();
    let e = g.mul(x, inv);
    check(&g, e, "1");
    assert!(g.div(x, Ex::ZERO).is_none());
}

#[test]
fn quarter_turns_and_signs_of_angles_share_one_sine() {
    let mut g = Graph::new();
    let q = g.coordinate_angle("q", &Number::zero());
    let (s, c) = g.sin_cos(&q);
    let half_pi = Number::pi().div(&Number::from_i64(2)).unwrap();
    for (turns, sin, cos) in [
        (1, "cos(q)", "-sin(q)"),
        (2, "-sin(q)", "-cos(q)"),
        (-1, "-cos(q)", "sin(q)"),
    ] {
        let angle = q.plus(
            &Angle::constant(half_pi.mul(&Number::from_i64(turns))),
            &Number::one(),
        );
        let (s2, c2) = g.sin_cos(&angle);
        assert_eq!((text(&g, s2).as_str(), text(&g, c2).as_str()), (sin, cos));
    }
    let (s3, c3) = g.sin_cos(&q.negated());
    assert_eq!((s3, c3), (g.neg(s), c));
}
