#include "simbody_world.h"

#include <SimTKsimbody.h>

#include <algorithm>
#include <set>
#include <utility>

namespace own {

namespace {

SimTK::Vec3 vec(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3d eigen(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

SimTK::Transform transform(const duet::Pose& pose) {
  return {SimTK::Rotation(SimTK::Quaternion(pose.R.w(), pose.R.x(), pose.R.y(), pose.R.z())), vec(pose.p)};
}

SimTK::MassProperties mass_of(const duet::RobotLink& link) {
  const Eigen::Matrix3d& I = link.inertia;
  const SimTK::Inertia central(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
  return {link.mass, vec(link.com), central.shiftFromMassCenter(vec(link.com), link.mass)};
}

// A surface on a link of the robot, or on the ground.
struct Surface {
  int link = -1;  // -1: the ground
  int shape = -1;
  bool meets_ground = false;
  SimTK::Transform X_LS;
  SimTK::ContactGeometry geometry;
};

// Simbody has no capsule. The ground meets spheres at the two ends, which is the capsule exactly; links meet an
// ellipsoid of its length and radius, which Gazebo's SimbodyPhysics.cc names beside its meshes.
std::vector<Surface> surfaces_of(const duet::RobotModel& robot) {
  const SimTK::Transform down(SimTK::Rotation(SimTK::Pi / 2, SimTK::YAxis));  // a half space is where x > 0
  std::vector<Surface> surfaces = {{-1, -1, true, down, SimTK::ContactGeometry::HalfSpace()}};
  for (int i = 0; i < static_cast<int>(robot.shapes.size()); ++i) {
    const duet::RobotShape& shape = robot.shapes[i];
    const SimTK::Transform X = transform(shape.X_LS);
    const bool sphere = shape.kind == duet::ShapeKind::kSphere;
    for (const double end : sphere ? std::vector<double>{0.0} : std::vector<double>{-1.0, 1.0}) {
      surfaces.push_back({shape.link, -1, true, X * SimTK::Vec3(0, 0, end * shape.half_length),
                          SimTK::ContactGeometry::Sphere(shape.radius)});
    }
    SimTK::ContactGeometry solid = SimTK::ContactGeometry::Sphere(shape.radius);
    if (!sphere)
      solid = SimTK::ContactGeometry::Ellipsoid({shape.radius, shape.radius, shape.radius + shape.half_length});
    surfaces.push_back({shape.link, i, false, X, solid});
  }
  return surfaces;
}

// Surfaces of one clique do not touch: cliques that cover all pairs but those that may.
template <typename MayTouch>
std::vector<std::vector<int>> cliques_of(int surfaces, MayTouch may_touch) {
  std::vector<std::vector<int>> cliques;
  std::set<std::pair<int, int>> covered;
  for (int i = 0; i < surfaces; ++i) {
    for (int j = i + 1; j < surfaces; ++j) {
      if (may_touch(i, j) || covered.count({i, j}) > 0) continue;
      std::vector<int> clique = {i, j};
      for (int k = 0; k < surfaces; ++k) {
        if (k != i && k != j &&
            std::none_of(clique.begin(), clique.end(), [&](int member) { return may_touch(member, k); }))
          clique.push_back(k);
      }
      for (const int a : clique)
        for (const int b : clique) covered.insert({a, b});
      cliques.push_back(clique);
    }
  }
  return cliques;
}

std::vector<SimTK::ContactSurface> with_materials(const std::vector<Surface>& surfaces, const duet::RobotModel& robot,
                                                  const SimbodySettings& settings) {
  // Simbody's friction of two surfaces is 2 a b / (a + b): that of the ground gives the pair's value.
  const double robot_mu = settings.friction_robot, pair = settings.friction_ground;
  std::vector<SimTK::ContactSurface> materials;
  for (const Surface& surface : surfaces) {
    const double mu = surface.link >= 0 ? robot_mu : pair * robot_mu / (2.0 * robot_mu - pair);
    materials.emplace_back(surface.geometry,
                           SimTK::ContactMaterial(settings.stiffness, settings.dissipation, mu, mu, 0.0));
  }
  const std::set<std::pair<int, int>> pairs(robot.self_collision.begin(), robot.self_collision.end());
  const auto may_touch = [&](int i, int j) {
    const Surface &a = surfaces[i], &b = surfaces[j];
    if (a.link < 0 || b.link < 0) return a.link != b.link && a.meets_ground && b.meets_ground;
    return settings.self_collision && pairs.count(std::minmax(a.shape, b.shape)) > 0;
  };
  for (const std::vector<int>& members : cliques_of(static_cast<int>(surfaces.size()), may_touch)) {
    const SimTK::ContactCliqueId clique = SimTK::ContactSurface::createNewContactClique();
    for (const int member : members) materials[member].joinClique(clique);
  }
  return materials;
}

}  // namespace

struct SimbodyWorld::Parts {
  Parts(const duet::RobotModel& robot, const SimbodySettings& settings, Drive drive_at);
  void make_links(const duet::RobotModel& robot, const SimbodySettings& settings,
                  const std::vector<SimTK::ContactSurface>& materials);
  void write(const duet::RobotState& state, SimTK::State& out) const;
  void read(const SimTK::State& state, duet::RobotState& out) const;
  void add_contacts(const SimTK::State& state, double share, std::vector<SurfaceContact>& out) const;

  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::GeneralForceSubsystem forces{system};
  SimTK::ContactTrackerSubsystem tracker{system};
  SimTK::CompliantContactSubsystem contact{system, tracker};
  std::vector<SimTK::MobilizedBody> links;
  std::vector<Surface> surfaces;
  std::vector<int> link_of;  // by Simbody's index of a surface
  std::unique_ptr<SimTK::SemiExplicitEulerIntegrator> integrator;
  SimTK::State rest;  // nothing has touched yet
  double inner_step = 0.0;
  Drive drive;
  LinkForces pushes;
  std::vector<SurfaceContact> touching, contacts;  // at the state where torques are asked; of a step
  duet::RobotState driven;                         // that state
};

// Torques and pushes at each evaluation of Simbody's.
class SimbodyWorld::Loads final : public SimTK::Force::Custom::Implementation {
 public:
  explicit Loads(Parts& parts) : parts_(parts) {}
  void calcForce(const SimTK::State& state, SimTK::Vector_<SimTK::SpatialVec>& bodies, SimTK::Vector_<SimTK::Vec3>&,
                 SimTK::Vector& mobilities) const override {
    parts_.read(state, parts_.driven);
    parts_.touching.clear();
    parts_.add_contacts(state, 1.0, parts_.touching);
    const Eigen::VectorXd& torques = parts_.drive(parts_.driven, parts_.touching);
    for (int i = 0; i < torques.size(); ++i)
      parts_.links[i + 1].applyOneMobilityForce(state, 0, torques[i], mobilities);
    for (std::size_t i = 0; i < parts_.pushes.size(); ++i) {
      const auto& [f_W, p_L] = parts_.pushes[i];
      if (!f_W.isZero(0.0)) parts_.links[i].applyForceToBodyPoint(state, vec(p_L), vec(f_W), bodies);
    }
  }
  SimTK::Real calcPotentialEnergy(const SimTK::State&) const override { return 0.0; }

 private:
  Parts& parts_;
};

SimbodyWorld::Parts::Parts(const duet::RobotModel& robot, const SimbodySettings& settings, Drive drive_at)
    : surfaces(surfaces_of(robot)), inner_step(settings.inner_step), drive(std::move(drive_at)) {
  driven.q = driven.v = Eigen::VectorXd::Zero(robot.dof());
  SimTK::Force::UniformGravity(forces, matter, vec(settings.gravity));
  SimTK::Force::Custom(forces, new Loads(*this));  // the subsystem owns it
  forces.setNumberOfThreads(1);
  contact.setTransitionVelocity(settings.transition_velocity);
  make_links(robot, settings, with_materials(surfaces, robot, settings));
  rest = system.realizeTopology();
  system.realizeModel(rest);
  for (SimTK::ContactSurfaceIndex i(0); i < tracker.getNumSurfaces(); ++i)
    link_of.push_back(tracker.getMobilizedBody(i).getMobilizedBodyIndex() - 1);  // the ground is the first body
  integrator = std::make_unique<SimTK::SemiExplicitEulerIntegrator>(system, inner_step);
  integrator->setAllowInterpolation(false);
}

void SimbodyWorld::Parts::make_links(const duet::RobotModel& robot, const SimbodySettings& settings,
                                     const std::vector<SimTK::ContactSurface>& materials) {
  std::vector<SimTK::Body::Rigid> bodies;
  for (const duet::RobotLink& link : robot.links) bodies.emplace_back(mass_of(link));
  matter.Ground().updBody().addContactSurface(surfaces[0].X_LS, materials[0]);
  for (std::size_t i = 1; i < surfaces.size(); ++i)
    bodies[surfaces[i].link].addContactSurface(surfaces[i].X_LS, materials[i]);
  links.push_back(SimTK::MobilizedBody::Free(matter.Ground(), SimTK::Transform(), bodies[0], SimTK::Transform()));
  for (std::size_t i = 1; i < robot.links.size(); ++i) {
    const duet::RobotLink& link = robot.links[i];
    const SimTK::Rotation R_LM(SimTK::UnitVec3(vec(link.axis)), SimTK::ZAxis);  // a Pin turns about z
    const SimTK::Transform X_PL = transform(link.X_PL);
    links.push_back(SimTK::MobilizedBody::Pin(links[link.parent], SimTK::Transform(X_PL.R() * R_LM, X_PL.p()),
                                              bodies[i], SimTK::Transform(R_LM)));
    SimTK::Force::MobilityLinearStop(forces, links.back(), SimTK::MobilizerQIndex(0), settings.stop_stiffness,
                                     settings.stop_dissipation, robot.joints[i - 1].lower, robot.joints[i - 1].upper);
  }
}

// The base has a quaternion and a position, and both velocities in W.
void SimbodyWorld::Parts::write(const duet::RobotState& state, SimTK::State& out) const {
  const Eigen::Quaterniond& R = state.X_WB.R;
  links[0].setQFromVector(out, SimTK::Vector(SimTK::Vec7(R.w(), R.x(), R.y(), R.z(), state.X_WB.p.x(), state.X_WB.p.y(),
                                                         state.X_WB.p.z())));
  const Eigen::Vector3d w_W = R * state.w_WB_B, v_W = state.v_WB;
  links[0].setUFromVector(out, SimTK::Vector(SimTK::Vec6(w_W.x(), w_W.y(), w_W.z(), v_W.x(), v_W.y(), v_W.z())));
  for (int i = 0; i < state.q.size(); ++i) {
    links[i + 1].setOneQ(out, 0, state.q[i]);
    links[i + 1].setOneU(out, 0, state.v[i]);
  }
}

void SimbodyWorld::Parts::read(const SimTK::State& state, duet::RobotState& out) const {
  const SimTK::Vector q = links[0].getQAsVector(state), u = links[0].getUAsVector(state);
  out.X_WB = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized(), {q[4], q[5], q[6]}};
  out.w_WB_B = out.X_WB.R.conjugate() * Eigen::Vector3d(u[0], u[1], u[2]);
  out.v_WB = {u[3], u[4], u[5]};
  for (int i = 0; i < out.q.size(); ++i) {
    out.q[i] = links[i + 1].getOneQ(state, 0);
    out.v[i] = links[i + 1].getOneU(state, 0);
  }
}

void SimbodyWorld::Parts::add_contacts(const SimTK::State& state, double share,
                                       std::vector<SurfaceContact>& out) const {
  const SimTK::ContactSnapshot& active = tracker.getActiveContacts(state);
  for (int i = 0; i < contact.getNumContactForces(state); ++i) {
    const SimTK::ContactForce& force = contact.getContactForce(state, i);
    const SimTK::Contact& pair = active.getContactById(force.getContactId());
    const int a = pair.getSurface1(), b = pair.getSurface2();
    auto found = std::find_if(out.begin(), out.end(), [&](const SurfaceContact& known) {
      return known.first_surface == a && known.second_surface == b;
    });
    if (found == out.end()) {
      out.push_back({a, b, link_of[a] >= 0 ? link_of[a] : link_of[b], link_of[a] >= 0 ? link_of[b] : -1});
      found = out.end() - 1;
    }
    const Eigen::Vector3d f_W = share * eigen(force.getForceOnSurface2()[1]);
    found->f_W += found->link == link_of[a] ? Eigen::Vector3d(-f_W) : f_W;
    found->p_W = eigen(force.getContactPoint());
    found->depth = SimTK::CircularPointContact::isInstance(pair)
                       ? SimTK::CircularPointContact::getAs(pair).getDepth()
                       : SimTK::EllipticalPointContact::getAs(pair).getDepth();
  }
}

SimbodyWorld::SimbodyWorld(const duet::RobotModel& robot, const SimbodySettings& settings, Drive drive)
    : parts_(std::make_unique<Parts>(robot, settings, std::move(drive))) {}

SimbodyWorld::~SimbodyWorld() = default;

bool SimbodyWorld::advance(duet::RobotState& state, int inner_steps, const LinkForces& forces) {
  Parts& parts = *parts_;
  parts.pushes = forces;
  parts.contacts.clear();
  SimTK::State start = parts.rest;
  parts.write(state, start);
  try {
    parts.integrator->initialize(start);
    for (int i = 1; i <= inner_steps; ++i) {
      parts.add_contacts(parts.integrator->getState(), 1.0 / inner_steps, parts.contacts);
      // The first call after initialize() only says that an interval begins.
      while (parts.integrator->stepTo(i * parts.inner_step) != SimTK::Integrator::ReachedReportTime) continue;
    }
  } catch (const std::exception&) {
    return false;
  }
  parts.read(parts.integrator->getState(), state);
  return true;
}

const std::vector<SurfaceContact>& SimbodyWorld::contacts() const { return parts_->contacts; }

std::string simbody_version() {
  int major = 0, minor = 0, build = 0;
  SimTK_version_simbody(&major, &minor, &build);
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(build);
}

}  // namespace own
