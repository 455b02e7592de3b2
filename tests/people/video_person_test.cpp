// One person of an estimator's file, as the camera has them.
#include "duet/people/video_person.h"

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/people/body_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::ScratchFolder;

// In single precision, and through a rotation matrix.
constexpr double kSingle = 2e-6;

std::string write(const ScratchFolder& folder, const std::string& name, const std::string& bytes) {
  write_file(folder / name, bytes);
  return folder / name;
}

TEST(VideoPerson, OfPhalpIsTheOneWhoIsSeenForLongest) {
  const ScratchFolder folder;
  const test::BodyParameters brief = test::body_parameters(4, 0.3, 23, {0.0, 0.0, 1.0});
  const test::BodyParameters longer = test::body_parameters(6, 1.2, 23, {0.5, 0.1, 40.0});
  const std::string path = write(folder, "video.pkl", test::phalp_pkl({{7, 0, brief}, {3, 2, longer}}, 9));
  ASSERT_TRUE(is_video_person(path));
  const VideoPerson person = read_video_person(path, {.depth_scale = 0.05});
  EXPECT_EQ(person.format, "4d-humans");
  EXPECT_EQ(person.rate_hz, 30.0);
  ASSERT_EQ(person.joints.frames(), 9);
  EXPECT_EQ(person.seen, (std::vector<bool>{false, false, true, true, true, true, true, true, false}));
  const test::PosedBody expected = test::posed(longer, rest_joints(average_body(), longer.betas));
  for (int t = 0; t < 6; ++t) {
    const Eigen::Vector3d nearer(0.0, 0.0, (0.05 - 1.0) * longer.translation[static_cast<std::size_t>(3 * t + 2)]);
    for (int j = 0; j < kSmplJoints; ++j)
      EXPECT_LE((person.joints.at(t + 2, j) - (expected.joints[static_cast<std::size_t>(t)].col(j) + nearer)).norm(),
                10 * kSingle)
          << t << " " << j;
  }
}

TEST(VideoPerson, OfTwoWhoAreSeenAsLongIsTheNearer) {
  const ScratchFolder folder;
  const test::BodyParameters far = test::body_parameters(3, 0.3, 23, {0.0, 0.0, 5.0});
  const test::BodyParameters near = test::body_parameters(3, 1.2, 23, {0.0, 0.0, 2.0});
  const VideoPerson person =
      read_video_person(write(folder, "v.pkl", test::phalp_pkl({{1, 0, far}, {2, 0, near}}, 3)), {.rate_hz = 25.0});
  EXPECT_NEAR(person.joints.at(0, kPelvis).z(), 2.0, 0.06);
  EXPECT_EQ(person.rate_hz, 25.0);
}

TEST(VideoPerson, OfGvhmrIsInTheCamerasFrame) {
  const ScratchFolder folder;
  const test::BodyParameters body = test::body_parameters(4, 0.3, 21, {0.2, 0.1, 2.5});
  const std::string path = write(folder, "hmr4d_results.pt", test::gvhmr_pt(body, "smpl_params_incam"));
  const VideoPerson person = read_video_person(path);
  EXPECT_EQ(person.format, "gvhmr");
  ASSERT_EQ(person.joints.frames(), 4);
  for (int t = 0; t < 4; ++t)
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(person.joints.at(t, kPelvis)[i], body.translation[static_cast<std::size_t>(3 * t + i)], kSingle);
}

TEST(VideoPerson, NamesWhatIsWrong) {
  const ScratchFolder folder;
  const auto refusal = [&](const std::string& name, const std::string& bytes) {
    return test::thrown_message<InputError>([&] { (void)read_video_person(write(folder, name, bytes)); });
  };
  const test::BodyParameters body = test::body_parameters(3, 0.3);
  EXPECT_SENTENCE(refusal("world.pt", test::gvhmr_pt(body)));
  EXPECT_SENTENCE(test::thrown_message<InputError>(
      [&] { (void)read_phalp_person(write(folder, "nobody.pkl", test::phalp_pkl({}, 2)), {}); }));
  EXPECT_SENTENCE(refusal("text.txt", "text"));
  EXPECT_FALSE(is_video_person(folder / "text.txt"));
}

}  // namespace
}  // namespace duet
