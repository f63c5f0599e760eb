use regen_tests::{derived::Derived, engine::Engine, random, reference::Random};
fn main() {
    let seed: u64 = std::env::args().nth(1).unwrap().parse().unwrap();
    let s = random::sample(seed).sample.unwrap();
    let m = &s.mechanism;
    let home = m.home().unwrap();
    let mut r = Random::new(seed);
    let st = m.random_state(&home, &mut r).unwrap();
    println!("home {:?} cond {}", home, m.conditioning(&home));
    println!(
        "q {:?} cond {} res {:e}",
        st.q,
        m.conditioning(&st.q),
        m.residual(&st.q)
    );
    println!(
        "sv {}",
        m.dependent_columns(&m.jacobian(&st.q)).singular_values()
    );
    println!("svA {}", m.jacobian(&st.q).singular_values());
    let d = Derived::without_base("x", &s.text).unwrap();
    println!("redundant {:?}", d.robot.redundant_rows);
    let mut t = st.q.clone();
    for k in &m.dependent {
        t[*k] += 0.005;
    }
    for _ in 0..8 {
        let stp = d.newton_step(&t).unwrap();
        for (k, x) in m.dependent.iter().zip(&stp) {
            t[*k] += x;
        }
        println!("{:?} res {:e}", stp, m.residual(&t));
    }
}
