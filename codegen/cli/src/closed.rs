//! Stand-in until the runtime's closure.
use regen_runtime::{Model, Status};

use crate::interpreted::Interpreted;
use crate::states::Motion;

pub(crate) fn close(model: &Interpreted<'_>, independent: &Motion) -> Result<Motion, String> {
    let info = model.info();
    let mut q = info.home.to_vec();
    let n = q.len();
    for step in 1..=20 {
        for (k, &i) in info.independent.iter().enumerate() {
            q[i] = info.home[i] + (independent.q[k] - info.home[i]) * f64::from(step) / 20.0;
        }
        for _ in 0..20 {
            let mut dq = vec![0.0; info.dependent.len()];
            let c = model.newton_step(&q, &mut dq).map_err(|e| e.to_string())?;
            if c.status() == Status::Singular {
                return Err("singular".to_owned());
            }
            for (k, &e) in info.dependent.iter().enumerate() {
                q[e] += dq[k];
            }
        }
    }
    let mut f = vec![0.0; info.rows];
    model.constraints(&q, &mut f).map_err(|e| e.to_string())?;
    if !f.iter().all(|f| f.abs() < 1e-9) {
        return Err("not closed".to_owned());
    }
    let mut qd = vec![0.0; n];
    let mut qdd = vec![0.0; n];
    let _ = model
        .velocities(&q, &independent.qd, &mut qd)
        .map_err(|e| e.to_string())?;
    let _ = model
        .accelerations(&q, &qd, &independent.qdd, &mut qdd)
        .map_err(|e| e.to_string())?;
    Ok(Motion { q, qd, qdd })
}
