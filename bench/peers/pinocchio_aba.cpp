// Time of Pinocchio's articulated-body algorithm on a rigid chain: planar joint for the spacecraft, revolute joints for the hinges.
//
// Standard input: n, mass, inertia, x0, y0, X_C, Y_C, M_C; then for each rod: length, mass, centre, inertia about it, C, D of
// its inner hinge, angle phi, rate phi' (chord angles). Output: seconds per right-hand side, then Vx', Vy', w', phi''.
// A right-hand side is: hinge moments, aba, and the change from joint angles to chord angles, as in Rodyn.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <vector>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/multibody.hpp>

namespace pin = pinocchio;

struct Rod { double length, mass, centre, inertia, stiffness, damping, angle, rate; };

int main() {
  int n;
  double mass, inertia, x0, y0, force[3];
  std::cin >> n >> mass >> inertia >> x0 >> y0 >> force[0] >> force[1] >> force[2];
  std::vector<Rod> rods(n);
  for (Rod& r : rods)
    std::cin >> r.length >> r.mass >> r.centre >> r.inertia >> r.stiffness >> r.damping >> r.angle >> r.rate;
  if (!std::cin) return 1;

  auto about_z = [](double m, double at, double i) {
    return pin::Inertia(m, Eigen::Vector3d(at, 0, 0), Eigen::Vector3d(i, i, i).asDiagonal().toDenseMatrix());
  };
  pin::Model model;
  model.gravity.setZero();
  auto joint = model.addJoint(0, pin::JointModelPlanar(), pin::SE3::Identity(), "spacecraft");
  model.appendBodyToJoint(joint, about_z(mass, 0, inertia), pin::SE3::Identity());
  Eigen::Vector3d at(x0, y0, 0);
  for (int k = 0; k < n; ++k) {
    joint = model.addJoint(joint, pin::JointModelRZ(), pin::SE3(Eigen::Matrix3d::Identity(), at), "hinge" + std::to_string(k));
    model.appendBodyToJoint(joint, about_z(rods[k].mass, rods[k].centre, rods[k].inertia), pin::SE3::Identity());
    at = Eigen::Vector3d(rods[k].length, 0, 0);
  }
  pin::Data data(model);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(model.nq), v = Eigen::VectorXd::Zero(model.nv), tau(model.nv), phi_rates(n);
  q[2] = 1;
  double angle = 0, rate = 0;
  for (int k = 0; k < n; ++k) {
    q[4 + k] = rods[k].angle - angle;
    v[3 + k] = rods[k].rate - rate;
    angle = rods[k].angle;
    rate = rods[k].rate;
  }

  auto evaluate = [&](pin::Convention convention) {
    for (int i = 0; i < 3; ++i) tau[i] = force[i];
    for (int k = 0; k < n; ++k) tau[3 + k] = -rods[k].stiffness * q[4 + k] - rods[k].damping * v[3 + k];
    const auto& a = pin::aba(model, data, q, v, tau, convention);
    double sum = 0;
    for (int k = 0; k < n; ++k) phi_rates[k] = (sum += a[3 + k]);
    return a[0];
  };
  double best = 1e30;
  const int calls = std::max(10, 40000 / n);
  const double q4 = q[4];
  for (int round = 0; round < 14; ++round) {
    const auto convention = round % 2 ? pin::Convention::LOCAL : pin::Convention::WORLD;
    const auto start = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) q[4] = q4 + 1e-12 * evaluate(convention);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / calls);
  }
  q[4] = q4;
  evaluate(pin::Convention::LOCAL);
  std::printf("%.6e", best);
  for (int i = 0; i < 3; ++i) std::printf(" %.17g", data.ddq[i]);
  for (int k = 0; k < n; ++k) std::printf(" %.17g", phi_rates[k]);
  std::printf("\n");
}
