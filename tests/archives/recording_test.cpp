#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <functional>
#include <limits>

#include "duet/archives/npy/npz.h"
#include "duet/archives/recording_file.h"
#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::ScratchFolder;
using test::thrown_message;

constexpr int kJoints = 29;

Pose random_pose(Random& random) {
  const Eigen::Quaterniond R(random.normal(), random.normal(), random.normal(), random.normal());
  return {R.normalized(), {random.normal(), random.normal(), random.normal()}};
}

Eigen::VectorXd random_vector(Random& random, int size) {
  Eigen::VectorXd vector(size);
  for (double& value : vector) value = random.normal();
  return vector;
}

Recording some_recording(int frames) {
  Random random(1, 1);
  Recording recording;
  recording.task = Task::kHighFive;
  recording.phases = {1, 3};
  recording.outcome = Outcome::kFell;
  recording.message = "pelvis below 0.3 m at 1.2 s";
  for (int t = 0; t < frames; ++t) {
    recording.robot.push_back({random_pose(random), random_vector(random, 3), random_vector(random, 3),
                               random_vector(random, kJoints), random_vector(random, kJoints)});
    recording.reference.push_back({random_pose(random), random_vector(random, kJoints)});
    recording.q_target.push_back(random_vector(random, kJoints));
    recording.contacts.push_back(
        {t, {t, ContactSide::kHuman, 5, random_vector(random, 3), random_vector(random, 3), 0.01}});
  }
  recording.partner = PointTracks(frames, 24);
  for (double& value : recording.partner.data()) value = random.normal();
  return recording;
}

void expect_equal(const Pose& a, const Pose& b) {
  EXPECT_EQ(a.p, b.p);
  EXPECT_EQ(a.R.coeffs(), b.R.coeffs());
}

void expect_equal(const Recording& a, const Recording& b) {
  EXPECT_EQ(a.task, b.task);
  EXPECT_EQ(a.phases, b.phases);
  EXPECT_EQ(a.rate_hz, b.rate_hz);
  EXPECT_EQ(a.outcome, b.outcome);
  EXPECT_EQ(a.message, b.message);
  EXPECT_EQ(a.partner.data(), b.partner.data());
  ASSERT_EQ(a.frames(), b.frames());
  for (std::size_t t = 0; t < a.robot.size(); ++t) {
    expect_equal(a.robot[t].X_WB, b.robot[t].X_WB);
    EXPECT_EQ(a.robot[t].v_WB, b.robot[t].v_WB);
    EXPECT_EQ(a.robot[t].w_WB_B, b.robot[t].w_WB_B);
    EXPECT_EQ(a.robot[t].q, b.robot[t].q);
    EXPECT_EQ(a.robot[t].v, b.robot[t].v);
    expect_equal(a.reference[t].X_WB, b.reference[t].X_WB);
    EXPECT_EQ(a.reference[t].q, b.reference[t].q);
    EXPECT_EQ(a.q_target[t], b.q_target[t]);
  }
  ASSERT_EQ(a.contacts.size(), b.contacts.size());
  for (std::size_t i = 0; i < a.contacts.size(); ++i) {
    EXPECT_EQ(a.contacts[i].frame, b.contacts[i].frame);
    EXPECT_EQ(a.contacts[i].contact.link, b.contacts[i].contact.link);
    EXPECT_EQ(a.contacts[i].contact.side, b.contacts[i].contact.side);
    EXPECT_EQ(a.contacts[i].contact.other, b.contacts[i].contact.other);
    EXPECT_EQ(a.contacts[i].contact.p_WC, b.contacts[i].contact.p_WC);
    EXPECT_EQ(a.contacts[i].contact.f_W, b.contacts[i].contact.f_W);
    EXPECT_EQ(a.contacts[i].contact.depth, b.contacts[i].contact.depth);
  }
}

TEST(Recording, IsTheSameBitsAfterItsFile) {
  const ScratchFolder folder;
  for (const int frames : {1, 5}) {
    const Recording recording = some_recording(frames);
    save_recording(recording, folder / "r.npz");
    expect_equal(load_recording(folder / "r.npz"), recording);
  }
}

TEST(Recording, WithoutFramesOrContactsIsARecording) {
  const ScratchFolder folder;
  Recording recording;
  recording.outcome = Outcome::kUnsupported;
  save_recording(recording, folder / "r.npz");
  EXPECT_EQ(load_recording(folder / "r.npz").frames(), 0);
  recording = some_recording(2);
  recording.contacts.clear();
  recording.partner = {};  // a robot alone
  save_recording(recording, folder / "r.npz");
  EXPECT_TRUE(load_recording(folder / "r.npz").contacts.empty());
  EXPECT_TRUE(load_recording(folder / "r.npz").partner.empty());
}

TEST(Recording, OnlyADivergedOneMayHoldNumbersThatAreNotFinite) {
  const ScratchFolder folder;
  Recording recording = some_recording(3);
  recording.robot[2].q[4] = std::numeric_limits<double>::quiet_NaN();
  recording.robot[2].X_WB.R.x() = std::numeric_limits<double>::quiet_NaN();
  recording.outcome = Outcome::kDiverged;
  save_recording(recording, folder / "r.npz");
  EXPECT_TRUE(std::isnan(load_recording(folder / "r.npz").robot[2].q[4]));
  recording.outcome = Outcome::kOk;
  save_recording(recording, folder / "r.npz");
  EXPECT_EQ(thrown_message<InputError>([&] { load_recording(folder / "r.npz"); }),
            "'" + (folder / "r.npz") + "': array 'q': expected finite numbers, found nan at index (2, 4)");
}

TEST(Recording, SaveRefusesSizesThatDisagree) {
  const ScratchFolder folder;
  const auto message_after = [&](const std::function<void(Recording&)>& change) {
    Recording recording = some_recording(3);
    change(recording);
    return thrown_message<std::invalid_argument>([&] { save_recording(recording, folder / "r.npz"); });
  };
  EXPECT_SENTENCE(message_after([](Recording& r) { r.reference.pop_back(); }));
  EXPECT_SENTENCE(message_after([](Recording& r) { r.q_target.clear(); }));
  EXPECT_SENTENCE(message_after([](Recording& r) { r.partner = PointTracks(2, 24); }));
  EXPECT_SENTENCE(message_after([](Recording& r) { r.partner = PointTracks(3, 22); }));
  EXPECT_SENTENCE(message_after([](Recording& r) { r.robot[1].v.resize(28); }));
}

// A robot's motion that somebody imported: nobody said what it is.
TEST(Recording, MayBeOfNoTask) {
  const ScratchFolder folder;
  Recording recording = some_recording(3);
  recording.task = std::nullopt;
  save_recording(recording, folder / "r.npz");
  EXPECT_EQ(Npz::load(folder / "r.npz").text("task"), "");
  EXPECT_EQ(load_recording(folder / "r.npz").task, std::nullopt);
}

TEST(Recording, LoadRefusesEachKindOfFault) {
  const ScratchFolder folder;
  save_recording(some_recording(3), folder / "r.npz");
  const auto message_after = [&](const std::function<void(Npz&)>& change) {
    Npz npz = Npz::load(folder / "r.npz");
    change(npz);
    npz.save(folder / "bad.npz");
    const std::string message = thrown_message<InputError>([&] { load_recording(folder / "bad.npz"); });
    const std::string name = "'" + (folder / "bad.npz") + "': ";
    return message.starts_with(name) ? message.substr(name.size()) : "(without the file's name) " + message;
  };
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set_text("schema", "x"); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set_integer("schema_version", 2); }));
  EXPECT_EQ(
      message_after([](Npz& n) { n.set_text("task", "hugs"); }),
      fmt::format("unknown task 'hugs': did you mean 'hug'? Known: {}", fmt::join(task_names(all_tasks()), ", ")));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set_number("rate_hz", 0.0); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("phases", std::vector<std::int64_t>{3, 1}, {2}); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("v", std::vector<double>(3 * 28), {3, 28}); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("root_quat_wxyz", std::vector<double>(12), {3, 4}); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("contact_frame", std::vector<std::int64_t>{0, 1, 3}, {3}); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("contact_side", std::vector<std::int64_t>{0, 1, 3}, {3}); }));
  EXPECT_SENTENCE(message_after([](Npz& n) { n.set("partner", std::vector<double>(3 * 22 * 3), {3, 22, 3}); }));
}

}  // namespace
}  // namespace duet
