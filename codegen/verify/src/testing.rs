//! Robots for tests.

/// An arm of two joints about parallel axes, in a vertical plane.
pub(crate) const ARM: &str = "\
name: arm
gravity: [0, -9.81, 0]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true}
";
