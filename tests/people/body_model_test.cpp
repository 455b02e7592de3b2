#include "duet/people/bodies/body_model.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <numbers>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/people/body_model_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::BodyParameters;
using test::SmallModel;
using test::thrown_message;
using ::testing::HasSubstr;

const std::vector<double> kBetas = {1.0, -0.5, 2.0, 0.25, -1.0, 0.5, 0.1, -0.2, 0.3, 3.0};

// ---- kinematics ------------------------------------------------------------

TEST(BodyKinematics, AxisAngleAgreesWithEigenAtAnyAngle) {
  for (const double angle : {0.0, 1e-12, 1e-6, 0.1, 1.0, 3.0, std::numbers::pi, 3.1415927, 3.2, 6.0, 50.0})
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-0.6, 0.0, 0.8), Eigen::Vector3d(1, 2, -3).normalized()}) {
      const Eigen::Quaterniond q = rotation_of_vector(angle * axis);
      EXPECT_NEAR(q.norm(), 1.0, 1e-14) << angle;
      EXPECT_LT((q.toRotationMatrix() - Eigen::AngleAxisd(angle, axis).toRotationMatrix()).norm(), 1e-13) << angle;
    }
}

TEST(BodyKinematics, JointsAndRotationsAreThoseOfHomogeneousTransforms) {
  const BodyParameters body = test::body_parameters(5, 0.7, 23);
  const RestJoints rest = SmallModel(24).rest(kBetas);
  const test::PosedBody expected = test::posed(body, rest);
  for (int t = 0; t < body.frames; ++t) {
    std::vector<Eigen::Quaterniond> rotations = {rotation_of_vector(Eigen::Vector3d(&body.root[3 * t]))};
    for (int j = 0; j < 23; ++j) rotations.push_back(rotation_of_vector(Eigen::Vector3d(&body.body[3 * (23 * t + j)])));
    PointTracks joints(1, kSmplJoints);
    pose_body(rest, Eigen::Vector3d(&body.translation[3 * t]), rotations, joints.frame(0));
    EXPECT_LT((joints.frame(0) - expected.joints[t]).norm(), 1e-13);
    for (int j = 0; j < kSmplJoints; ++j)
      EXPECT_LT((rotations[j].toRotationMatrix() - expected.rotations[kSmplJoints * t + j]).norm(), 1e-13) << j;
  }
}

// A body turns about its pelvis: to turn the world by R, the translation becomes R (trans + p0) - p0, not R trans.
TEST(BodyKinematics, TurningParametersTurnsAboutThePelvis) {
  const RestJoints rest = SmallModel(24).rest(kBetas);
  const Eigen::Quaterniond R(Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitX()));  // y up -> z up
  const Eigen::Vector3d p0 = rest.col(kPelvis), translation(0.3, 0.9, -2.0);
  ASSERT_GT(p0.norm(), 0.1);
  std::vector<Eigen::Quaterniond> before(kSmplJoints, rotation_of_vector({0.1, 0.2, 0.3})), after = before;
  after[kPelvis] = R * before[kPelvis];
  PointTracks a(1, kSmplJoints), b(1, kSmplJoints), naive(1, kSmplJoints);
  std::vector<Eigen::Quaterniond> third = after;
  pose_body(rest, translation, before, a.frame(0));
  pose_body(rest, R * (translation + p0) - p0, after, b.frame(0));
  pose_body(rest, R * translation, third, naive.frame(0));
  const Eigen::Matrix3Xd turned = R.toRotationMatrix() * a.frame(0);
  EXPECT_LT((b.frame(0) - turned).norm(), 1e-13);
  EXPECT_GT((naive.frame(0) - turned).norm(), 0.1);
}

// ---- models ------------------------------------------------------------

TEST(BodyModel, EveryKindAndContainerGivesTheSameJoints) {
  for (const auto& [joints, kind] : {std::pair{24, "SMPL"}, std::pair{52, "SMPL-H"}, std::pair{55, "SMPL-X"}}) {
    const SmallModel small(joints);
    const test::ScratchFolder folder;
    const std::vector<std::pair<std::string, std::string>> files = {
        {"model.npz", small.npz().bytes()},
        {"dense.pkl", small.pickle(SmallModel::Matrix::kDense)},
        {"columns.pkl", small.pickle(SmallModel::Matrix::kColumns)},
        {"old.pkl", small.pickle(SmallModel::Matrix::kColumns, true)},
        {"rows.pkl", small.pickle(SmallModel::Matrix::kRows)}};
    for (const auto& [name, bytes] : files) {
      write_file(folder / name, bytes);
      const BodyModel model = load_body_model(folder / name);
      EXPECT_EQ(model.kind, kind) << name;
      ASSERT_EQ(model.dirs.size(), 10U);
      EXPECT_LT((rest_joints(model, kBetas) - small.rest(kBetas)).norm(), 1e-12) << name;
      EXPECT_LT((rest_joints(model, {}) - small.rest(std::vector<double>(10))).norm(), 1e-12) << name;
    }
  }
}

TEST(BodyModel, JointsAreKeptBesideTheFileUntilItChanges) {
  const test::ScratchFolder folder;
  const std::string path = folder / "SMPL_NEUTRAL.npz";
  SmallModel(24).npz().save(path);
  const BodyModel first = load_body_model(path);
  EXPECT_SENTENCE(first.note);
  const BodyModel again = load_body_model(path);
  EXPECT_SENTENCE(again.note);
  EXPECT_EQ(again.kind, "SMPL");
  EXPECT_LT((rest_joints(again, kBetas) - rest_joints(first, kBetas)).norm(), 1e-15);
  // The file that is kept is a shape basis for retargeting, and a model of its own.
  const BodyModel alone = load_body_model(path + ".duet-joints.npz");
  EXPECT_LT((rest_joints(alone, kBetas) - rest_joints(first, kBetas)).norm(), 1e-15);
  SmallModel(55).npz().save(path);
  EXPECT_EQ(load_body_model(path).kind, "SMPL-X");
  write_file(path + ".duet-joints.npz", "damaged");
  EXPECT_EQ(load_body_model(path).kind, "SMPL-X");
}

TEST(BodyModel, AFolderThatTakesNoFileIsSaid) {
  const test::ScratchFolder folder;
  const std::string path = folder / "model.npz";
  SmallModel(24).npz().save(path);
  std::filesystem::create_directory(path + ".duet-joints.npz");  // also root cannot write a file there
  const BodyModel model = load_body_model(path);
  EXPECT_SENTENCE(model.note);
  EXPECT_EQ(model.kind, "SMPL");
}

TEST(BodyModel, TheAveragePersonIsAPersonInTheModelsAxes) {
  const BodyModel model = average_body();
  EXPECT_TRUE(model.kind.empty());
  EXPECT_TRUE(model.joints.col(kPelvis).isZero());
  EXPECT_GT(model.joints(0, kLeftWrist), 0.5);                              // x: left
  EXPECT_GT(model.joints(1, kHead), 0.5);                                   // y: up
  EXPECT_GT(model.joints(2, kLeftToe) - model.joints(2, kLeftAnkle), 0.1);  // z: forward
  EXPECT_NEAR(model.joints(1, kHead) - model.joints(1, kLeftAnkle), 1.47, 0.05);
  EXPECT_SENTENCE(model.note);
  EXPECT_EQ(rest_joints(model, kBetas), model.joints);
}

TEST(BodyModel, FaultsAreNamed) {
  const test::ScratchFolder folder;
  const auto refusal = [&](const std::string& bytes) {
    write_file(folder / "m.bin", bytes);
    return thrown_message<InputError>([&] { (void)load_body_model(folder / "m.bin"); });
  };
  const SmallModel small(24);
  const auto with = [&](const std::string& key, std::vector<double> values, std::vector<std::size_t> shape) {
    Npz npz = small.npz();
    npz.set(key, std::move(values), std::move(shape));
    return refusal(npz.bytes());
  };
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)load_body_model(folder / "absent.npz"); }));
  EXPECT_SENTENCE(refusal(""));
  EXPECT_SENTENCE(refusal(inter_x_npz(test::body_parameters(2, 1)).bytes()));
  for (const char* text : {"\x80\x02}.",
                           "\x80\x02"
                           "cchumpy.ch\nCh\n)\x81.",
                           "\x80\x02"
                           "cos\nsystem\n."})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(with("J_regressor", std::vector<double>(20 * 48), {20, 48}));
  EXPECT_SENTENCE(with("J_regressor", std::vector<double>(24 * 47), {24, 47}));
  EXPECT_SENTENCE(with("J_regressor", std::vector<double>(24 * 48), {24, 48}));
  EXPECT_SENTENCE(with("shapedirs", std::vector<double>(48 * 30), {48, 30}));
  EXPECT_SENTENCE(with("v_template", std::vector<double>(48 * 3, NAN), {48, 3}));
  std::vector<double> one_is_none(48 * 3, 0.0);
  one_is_none[5 * 3 + 2] = NAN;
  EXPECT_SENTENCE(with("v_template", one_is_none, {48, 3}));
  const std::string good = small.pickle(SmallModel::Matrix::kColumns);
  for (std::size_t size = 0; size < good.size(); size += 97)
    EXPECT_THAT(refusal(good.substr(0, size)), HasSubstr("m.bin")) << size;
}

TEST(BodyModel, ASparseMatrixThatIsNoneIsRefused) {
  const test::ScratchFolder folder;
  const SmallModel small(24);
  std::string bytes = small.pickle(SmallModel::Matrix::kColumns);
  const auto refusal = [&](const std::string& key, char value, std::size_t offset) {
    std::string edited = bytes;
    edited[edited.find(key) + offset] = value;
    write_file(folder / "m.pkl", edited);
    return thrown_message<InputError>([&] { (void)load_body_model(folder / "m.pkl"); });
  };
  EXPECT_SENTENCE(refusal("_shape", '\x11', 7));
  EXPECT_SENTENCE(refusal("_shape", 'x', 0));
  EXPECT_SENTENCE(refusal("indptr", 'x', 0));
}

}  // namespace
}  // namespace duet
