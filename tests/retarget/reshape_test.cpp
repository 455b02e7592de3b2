#include "duet/retarget/reshape.h"

#include "duet/archives/npy/npz.h"
#include "duet/core/require.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

ShapeBasis random_basis(unsigned seed, int shapes = 10) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0.0, 0.01);
  ShapeBasis basis;
  basis.joints = Eigen::Matrix3Xd::Zero(3, kSmplJoints);
  const auto offsets = test::person_offsets();
  for (int j = 0; j < kSmplJoints; ++j) {
    const Eigen::Vector3d parent =
        j == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(basis.joints.col(kSmplParents[j]));
    basis.joints.col(j) = parent + offsets[j];
  }
  for (int b = 0; b < shapes; ++b) {
    basis.dirs.push_back(Eigen::Matrix3Xd::NullaryExpr(3, kSmplJoints, [&] { return normal(engine); }));
  }
  return basis;
}

void save(const ShapeBasis& basis, const std::string& path) {
  std::vector<double> rest;
  std::vector<double> dirs;
  for (int j = 0; j < kSmplJoints; ++j) {
    for (int c = 0; c < 3; ++c) {
      rest.push_back(basis.joints(c, j));
      for (const Eigen::Matrix3Xd& dir : basis.dirs) dirs.push_back(dir(c, j));
    }
  }
  Npz archive;
  archive.set("J_template", rest, {24, 3});
  archive.set("J_shapedirs", dirs, {24, 3, basis.dirs.size()});
  archive.save(path);
}

struct Setting {
  PairChain chain = make_chain(test::g1(), ContactKeypoints::kNine);
  PairTree tree = make_pair_tree(test::g1());
  PairBones bones = robot_bones(chain, tree);
};

TEST(PairTree, ParentIsTheNearestPairedAncestor) {
  const PairTree tree = make_pair_tree(test::g1());
  const std::array<int, kRetargetPairs> expected = {-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 3, 6};
  EXPECT_EQ(tree.parent, expected);
  std::array<bool, kRetargetPairs> seen{};
  for (const int i : tree.order) {
    EXPECT_TRUE(tree.parent[i] < 0 || seen[tree.parent[i]]) << i;
    seen[i] = true;
  }
}

TEST(Reshape, KeepsDirectionsAndTakesLengths) {
  const Setting s;
  const HumanMotion source = test::random_person(20, 50.0, 3, 1.0, 0.5);
  const PointTracks out = reshape(source, s.tree, s.bones.length, 0.8);
  for (int t = 0; t < 20; ++t) {
    const Eigen::Vector3d pelvis = source.joints.at(t, kPelvis);
    EXPECT_EQ(out.at(t, 0), Eigen::Vector3d(pelvis.x(), pelvis.y(), 0.8 * pelvis.z()));
    for (int i = 1; i < kRetargetPairs; ++i) {
      const int parent = s.tree.parent[i];
      const Eigen::Vector3d bone = out.at(t, i) - out.at(t, parent);
      const Eigen::Vector3d from = source.joints.at(t, s.tree.smpl[i]) - source.joints.at(t, s.tree.smpl[parent]);
      EXPECT_NEAR(bone.norm(), s.bones.length[i], 1e-12);
      EXPECT_NEAR(bone.normalized().dot(from.normalized()), 1.0, 1e-12);
    }
  }
}

TEST(Reshape, RefusesJointsThatCoincide) {
  const Setting s;
  HumanMotion source = test::random_person(6, 50.0, 3, 0.0, 0.0);
  source.joints.at(4, kLeftHand) = source.joints.at(4, kLeftElbow);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { reshape(source, s.tree, s.bones.length, 1.0); }));
}

// A person who stands straight with the soles on the ground becomes a robot that does.
TEST(HeightScale, StandingPersonKeepsTheGround) {
  const Setting s;
  HumanMotion source;
  source.joints = PointTracks(5, kSmplJoints);
  const auto offsets = test::person_offsets();
  for (int t = 0; t < 5; ++t) {
    for (int j = 0; j < kSmplJoints; ++j) {
      const Eigen::Vector3d parent =
          j == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(source.joints.at(t, kSmplParents[j]));
      source.joints.at(t, j) = parent + offsets[j];
    }
  }
  const double scale = height_scale(test::g1(), s.chain, s.tree, source);
  const PointTracks out = reshape(source, s.tree, s.bones.length, scale);
  const double sole = 0.035;  // below the G1's ankle
  EXPECT_NEAR(out.at(0, 3).z(), sole, 0.02);
  EXPECT_NEAR(out.at(0, 0).z(), 0.79, 0.03);
}

TEST(ShapeFit, GradientIsTheSlope) {
  const Setting s;
  const ShapeBasis basis = random_basis(1);
  const Eigen::VectorXd beta = Eigen::VectorXd::LinSpaced(10, -1.5, 1.0);
  Eigen::VectorXd gradient;
  shape_loss(basis, s.tree, s.bones, beta, 0.8, &gradient);
  const double h = 1e-6;
  for (int i = 0; i < 11; ++i) {
    const auto at = [&](double step) {
      Eigen::VectorXd moved = beta;
      if (i < 10) moved[i] += step;
      return shape_loss(basis, s.tree, s.bones, moved, i < 10 ? 0.8 : 0.8 + step, nullptr);
    };
    EXPECT_NEAR(gradient[i], (at(h) - at(-h)) / (2.0 * h), 1e-8) << i;
  }
}

// A robot whose bones are those of a known shape and scale: the fit must find bones of the same length.
TEST(ShapeFit, FindsTheBonesOfAKnownBody) {
  Setting s;
  const ShapeBasis basis = random_basis(2);
  const Eigen::VectorXd beta = Eigen::VectorXd::LinSpaced(10, 1.2, -0.8);
  for (int i = 1; i < kRetargetPairs; ++i) {
    Eigen::Vector3d bone = basis.joints.col(s.tree.smpl[i]) - basis.joints.col(s.tree.smpl[s.tree.parent[i]]);
    for (int b = 0; b < 10; ++b) {
      bone += beta[b] * (basis.dirs[b].col(s.tree.smpl[i]) - basis.dirs[b].col(s.tree.smpl[s.tree.parent[i]]));
    }
    s.bones.length[i] = 0.78 * bone.norm();
  }
  const ShapeFit fit = fit_shape(basis, s.tree, s.bones);
  ASSERT_EQ(fit.loss.size(), 500U);
  EXPECT_LT(fit.loss.back(), 1e-6 * fit.loss.front());
  EXPECT_NEAR(fit.scale, 0.78, 0.05);
  for (int i = 1; i < kRetargetPairs; ++i) EXPECT_NEAR(fit.length[i], s.bones.length[i], 1e-3) << i;
}

TEST(ShapeFit, ReadsABasisFromNpz) {
  const test::ScratchFolder folder;
  const ShapeBasis basis = random_basis(3, 16);
  const std::string path = folder / "basis.npz";
  save(basis, path);
  const ShapeBasis loaded = load_shape_basis(path);
  EXPECT_EQ(loaded.joints, basis.joints);
  ASSERT_EQ(loaded.dirs.size(), 10U);  // the printed number of shapes, whatever the file holds
  for (int b = 0; b < 10; ++b) EXPECT_EQ(loaded.dirs[b], basis.dirs[b]);
}

TEST(ShapeFit, RefusesBrokenFilesByName) {
  const test::ScratchFolder folder;
  Npz archive;
  archive.set("J_template", std::vector<double>(72, 0.0), {24, 3});
  archive.save(folder / "no-dirs.npz");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_shape_basis(folder / "no-dirs.npz"); }));
  archive.set("J_shapedirs", std::vector<double>(23 * 30, 0.0), {23, 3, 10});
  archive.save(folder / "wrong-shape.npz");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_shape_basis(folder / "wrong-shape.npz"); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_shape_basis(folder / "absent.npz"); }));
}

}  // namespace
}  // namespace duet
