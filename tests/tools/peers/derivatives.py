#!/usr/bin/env python3
"""Compares the derivatives of inverse and forward dynamics of serial arms with Pinocchio's, and the
times of one call, in one program that links our C and Pinocchio's C++.

    python3 tests/tools/peers/derivatives.py             # installs the peers into a virtual environment first
    python3 tests/tools/peers/derivatives.py ROBOT...    # only these

Bodies have random physical inertias; friction and rotors are 0, since Pinocchio's derivatives have none.
Of robots with loops only our times are printed, at home.
"""
import sys

import peers

STATES = 100
MAIN = r"""
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/rnea-derivatives.hpp>
#include <pinocchio/algorithm/aba-derivatives.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <cstdlib>
TIMER
HEADERS
using namespace pinocchio;
static Model arm(int n, const double (*t)[3], const double *g) {
  Model m;
  m.gravity.linear() << g[0], g[1], g[2];
  for (int i = 0; i < n; i++) {
    double ca = cos(t[i][0]), sa = sin(t[i][0]);
    Eigen::Matrix3d R; R << 1, 0, 0, 0, ca, -sa, 0, sa, ca;
    SE3 p(R, Eigen::Vector3d(t[i][1], -sa * t[i][2], ca * t[i][2]));
    JointIndex j = m.addJoint(i, JointModelRZ(), p, "j" + std::to_string(i));
    m.appendBodyToJoint(j, Inertia::Random(), SE3::Identity());
  }
  return m;
}
// the largest difference, relative to the largest entry; ours is column by column
static double apart(const Eigen::MatrixXd &theirs, const double *ours) {
  double most = 0, size = theirs.cwiseAbs().maxCoeff();
  for (int k = 0; k < theirs.size(); k++) most = std::max(most, fabs(theirs.data()[k] - ours[k]));
  return most / size;
}
template <class F> static double time_of(F f) {
  double best = 1e30;
  for (int r = 0; r < 300; r++) { double s = now(); for (int k = 0; k < CALLS; k++) f(); s = (now() - s) / CALLS; if (s < best) best = s; }
  return best;
}
int main() {
PARTS
}
"""
PART = r"""
  {
    const int n = JOINTS;
    static const double t[][3] = {TABLE}, g[3] = {GRAVITY};
    Model m = arm(n, t, g); Data d(m);
    double phi[ROBOT_MACRO_PARAMETER_COUNT] = {};
    for (int b = 0; b < n; b++) {
      auto p = m.inertias[b + 1].toDynamicParameters();  // m, m c, Ixx Ixy Iyy Ixz Iyz Izz
      const int to[10] = {9, 6, 7, 8, 0, 1, 3, 2, 4, 5};
      for (int k = 0; k < 10; k++) phi[10 * b + to[k]] = p[k];
    }
    Eigen::VectorXd q(n), v(n), a(n), tau(n), qdd(n), x(n);
    Eigen::MatrixXd by_q = Eigen::MatrixXd::Zero(n, n), by_v = by_q, by_a = by_q;
    double slopes[3 * n * n], out[n], worst[5] = {};
    for (int state = 0; state < STATES; state++) {
      q.setRandom(); q *= 3; v.setRandom(); a.setRandom(); v *= 2; a *= 5;
      by_a.setZero();
      computeRNEADerivatives(m, d, q, v, a, by_q, by_v, by_a);
      ROBOT_inverse_dynamics_derivatives(q.data(), v.data(), a.data(), phi, slopes);
      worst[0] = std::max(worst[0], apart(by_q, slopes));
      worst[1] = std::max(worst[1], apart(by_v, slopes + n * n));
      tau = rnea(m, d, q, v, a);
      computeABADerivatives(m, d, q, v, tau, by_q, by_v, by_a);
      by_a.triangularView<Eigen::StrictlyLower>() = by_a.transpose();
      ROBOT_forward_dynamics_derivatives(q.data(), v.data(), tau.data(), phi, slopes);
      worst[2] = std::max(worst[2], apart(by_q, slopes));
      worst[3] = std::max(worst[3], apart(by_v, slopes + n * n));
      worst[4] = std::max(worst[4], apart(by_a, slopes + 2 * n * n));
    }
    printf("ROBOT: tau by q %.1e, by qd %.1e; qdd by q %.1e, by qd %.1e, by tau %.1e\n", worst[0], worst[1], worst[2], worst[3], worst[4]);
    double best[3][2];
    for (auto &row : best) row[0] = row[1] = 1e30;
    for (int turn = 0; turn < 3; turn++) {
      double of[3][2] = {
        {time_of([&] { KEEP(q.data()); ROBOT_inverse_dynamics_derivatives(q.data(), v.data(), a.data(), phi, slopes); KEEP(slopes); }),
         time_of([&] { KEEP(q.data()); computeRNEADerivatives(m, d, q, v, a, by_q, by_v, by_a); KEEP(by_q.data()); })},
        {time_of([&] { KEEP(q.data()); ROBOT_forward_dynamics(q.data(), v.data(), tau.data(), phi, out); KEEP(out); }),
         time_of([&] { KEEP(q.data()); aba(m, d, q, v, tau, Convention::LOCAL); KEEP(d.ddq.data()); })},
        {time_of([&] { KEEP(q.data()); ROBOT_forward_dynamics_derivatives(q.data(), v.data(), tau.data(), phi, slopes); KEEP(slopes); }),
         time_of([&] { KEEP(q.data()); computeABADerivatives(m, d, q, v, tau, by_q, by_v, by_a); KEEP(by_q.data()); })}};
      for (int f = 0; f < 3; f++) for (int k = 0; k < 2; k++) best[f][k] = std::min(best[f][k], of[f][k]);
    }
    const char *names[3] = {"inverse dynamics' derivatives", "forward dynamics", "its derivatives"};
    for (int f = 0; f < 3; f++) printf("  %s: ours %.0f ns, Pinocchio %.0f ns, ratio %.2f\n", names[f], best[f][0], best[f][1], best[f][0] / best[f][1]);
  }
"""

LOOPS = {"fivebar": "fivebar", "3rps": "rps3", "stewart": "stewart"}
LOOP = r"""
  {
    enum { n = ROBOT_MACRO_COORDINATE_COUNT, m = ROBOT_MACRO_INDEPENDENT_COUNT };
    double phi[ROBOT_MACRO_PARAMETER_COUNT] = {}, qd[n], qdd[n], given[m], tau[m];
    static double out[3 * m * m];
    for (int b = 0; b < ROBOT_MACRO_BODY_COUNT; b++) for (int k : {0, 3, 5, 9}) phi[10 * b + k] = k == 9 ? 1 : 0.1;
    for (int k = 0; k < m; k++) given[k] = 0.3 + 0.1 * k;
    const double *q = ROBOT_home;
    ROBOT_velocities(q, given, qd);
    ROBOT_accelerations(q, qd, given, qdd);
    ROBOT_inverse_dynamics(q, qd, qdd, phi, tau);
    printf("ROBOT: inverse dynamics %.0f ns, its derivatives %.0f ns, forward dynamics %.0f ns, its derivatives %.0f ns\n",
      1.0 * time_of([&] { KEEP(q); ROBOT_inverse_dynamics(q, qd, qdd, phi, out); KEEP(out); }),
      1.0 * time_of([&] { KEEP(q); ROBOT_inverse_dynamics_derivatives(q, qd, qdd, phi, out); KEEP(out); }),
      1.0 * time_of([&] { KEEP(q); ROBOT_forward_dynamics(q, qd, tau, phi, out); KEEP(out); }),
      1.0 * time_of([&] { KEEP(q); ROBOT_forward_dynamics_derivatives(q, qd, tau, phi, out); KEEP(out); }));
  }
"""


def c_files(robot):
    """Our C of a robot with the functions of controllers."""
    text = (peers.ROOT / "robots" / f"{robot}.yaml").read_text()
    description = peers.WORK / f"{robot}.yaml"
    description.write_text(text if "\ncontrol: true" in text else text + "\ncontrol: true\n")
    peers.run([peers.regen(), "generate", description.name, "--target", "c", "--out", "."], cwd=peers.WORK)
    name = LOOPS.get(robot, robot)
    # the functions on float would take as long to compile
    options = ["-std=c99", "-O3", "-march=native", f"-D{name.upper()}_NO_FLOAT"]
    peers.run(["gcc", *options, "-c", f"{name}.c"], cwd=peers.WORK)


def main():
    peers.WORK.mkdir(parents=True, exist_ok=True)
    peers.in_environment()
    parts = ""
    robots = sys.argv[1:] or [*peers.SERIAL, *LOOPS]
    for robot in robots:
        c_files(robot)
        if robot in LOOPS:
            name = LOOPS[robot]
            parts += LOOP.replace("ROBOT_MACRO", name.upper()).replace("ROBOT", name)
            continue
        rows, gravity = peers.links(robot)
        words = {
            "ROBOT_MACRO": robot.upper(),
            "ROBOT": robot,
            "JOINTS": str(len(rows)),
            "TABLE": ", ".join("{" + ", ".join(map(repr, row)) + "}" for row in rows),
            "GRAVITY": ", ".join(map(repr, gravity)),
            "STATES": str(STATES),
        }
        part = PART
        for word, value in words.items():
            part = part.replace(word, value)
        parts += part
    names = [LOOPS.get(robot, robot) for robot in robots]
    headers = 'extern "C" {\n' + "".join(f'#include "{name}.h"\n' for name in names) + "}\n"
    code = MAIN.replace("TIMER", peers.TIMER).replace("HEADERS", headers).replace("PARTS", parts)
    (peers.WORK / "derivatives.cpp").write_text(code)
    objects = [f"{name}.o" for name in names]
    program = peers.link_pinocchio("derivatives.cpp", objects)
    print(peers.run([program], cwd=peers.WORK), end="")


if __name__ == "__main__":
    sys.exit(main())
