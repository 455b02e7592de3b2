
#include <algorithm>

#include "duet/core/require.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/scheduler.h"
#include "tests/nn/onnx_writer.h"
#include "tests/policies/external_fixtures.h"

namespace duet {
namespace {

using test::g1;
using test::MovingHistory;
using test::OnnxWriter;
using test::replaced;
using test::thrown_message;

constexpr double kFloat = 2e-6;  // rounding of positions of a few metres to float

std::string descriptor() {
  return "schema: duet.policy/1\nname: mine\nabout: a test\nkind: onnx\nnetwork: mine.onnx\njoints: " +
         test::joint_list() + R"(
frame_of_reference: world
inputs:
  - {name: obs, frames: 12, channels: [partner_root]}
output: {anchors: 5}
)";
}

// A network whose plan is a constant, whatever it is shown (`inputs`: names and sizes).
std::string constant_network(const std::vector<std::pair<std::string, int>>& inputs, const std::vector<float>& plan) {
  OnnxWriter writer;
  std::string sum;
  for (const auto& [name, size] : inputs) {
    writer.input(name, {1, size});
    writer.constant("zero_" + name, {size, 1}, std::vector<float>(size, 0.0F));
    writer.node("MatMul", {name, "zero_" + name}, {"none_" + name});
    if (!sum.empty()) writer.node("Add", {sum, "none_" + name}, {sum + name});
    sum = sum.empty() ? "none_" + name : sum + name;
  }
  writer.constant("numbers", {1, static_cast<std::int64_t>(plan.size())}, plan);
  writer.node("Add", {sum, "numbers"}, {"plan"});
  writer.output("plan", {1, static_cast<std::int64_t>(plan.size())});
  return writer.bytes();
}

std::vector<float> standing_plan(int anchors) {
  std::vector<float> plan;
  for (int i = 0; i < anchors; ++i) {
    plan.insert(plan.end(), {0.1F * static_cast<float>(i), 0.2F, 0.75F, 1.0F, 0.0F, 0.0F, 0.0F});
    plan.insert(plan.end(), 29, 0.01F * static_cast<float>(i));
  }
  return plan;
}

class Files {
 public:
  void write(const std::string& text, const std::string& network) const {
    write_file(folder_ / "mine.yaml", text);
    write_file(folder_ / "mine.onnx", network);
  }
  [[nodiscard]] std::string path() const { return folder_ / "mine.yaml"; }
  [[nodiscard]] std::string network() const { return folder_ / "mine.onnx"; }
  [[nodiscard]] std::string refusal() const {
    return thrown_message<InputError>([&] { make_policy(path(), g1()); });
  }

 private:
  test::ScratchFolder folder_;
};

TEST(OnnxPolicy, IsAsGoodAsOneThatShips) {
  const Files files;
  const std::string network = constant_network({{"obs", 36}}, standing_plan(5));
  files.write(descriptor(), network);
  EXPECT_EQ(policy_info(files.path()).name, "mine");
  const auto policy = make_policy(files.path(), g1());
  EXPECT_EQ(policy->name(), "mine");
  const MovingHistory history(1);
  policy->reset(test::episode(history.at(0).now().robot));
  const std::vector<Reference> plan = policy->plan(history.at(0));
  ASSERT_EQ(plan.size(), 100U);
  EXPECT_NEAR(plan[50].X_WB.p.x(), 0.2, kFloat);
  EXPECT_NEAR(plan[60].X_WB.p.x(), 0.24, kFloat);
  EXPECT_NEAR(plan[0].X_WB.p.z(), 0.75, kFloat);
  EXPECT_NEAR(policy->act(history.at(10))[2].X_WB.p.x(), 0.2, kFloat);
  EXPECT_FALSE(policy->faults().any());
  Scheduler scheduler;
  scheduler.reset(plan[0]);
  scheduler.push(plan, 0);
}

TEST(OnnxPolicy, BetweenAnchorsIsWhatDensifyMakes) {
  PolicyDescriptor description;
  std::vector<int> joints(29);
  for (int i = 0; i < 29; ++i) joints[i] = i;
  const PlanDecoder decoder(description, g1(), joints);
  Random random(5, 1);
  std::vector<float> numbers;
  for (int a = 0; a < 5; ++a)
    for (int i = 0; i < 36; ++i) numbers.push_back(static_cast<float>(0.3 * random.normal()));
  const std::vector<Reference> plan = decoder.decode(numbers, {}).references;
  ASSERT_EQ(plan.size(), 100U);
  const Anchors anchors = {plan[0], plan[25], plan[50], plan[75], plan[75]};
  const std::vector<Reference> dense = densify(anchors);
  for (std::size_t i = 0; i < 75; ++i) {
    EXPECT_NEAR((dense[i].q - plan[i].q).norm(), 0.0, test::kAlgebra);
    EXPECT_NEAR((dense[i].X_WB.p - plan[i].X_WB.p).norm(), 0.0, test::kAlgebra);
    for (int j = 0; j < 29; ++j) {
      EXPECT_GE(plan[i].q[j], g1()->joints[j].lower);
      EXPECT_LE(plan[i].q[j], g1()->joints[j].upper);
    }
  }
}

// Checks that each output frame gives the same place.
TEST(OnnxPolicy, RootsComeBackFromEveryFrame) {
  const MovingHistory history(2);
  const RobotState& now = history.at(0).now().robot;
  std::vector<int> joints(29);
  for (int i = 0; i < 29; ++i) joints[i] = i;
  Random random(3, 1);
  const Reference goal = test::random_reference(random, 29);
  for (const PlanFrame frame : {PlanFrame::kWorld, PlanFrame::kEgo, PlanFrame::kDisplacement}) {
    PolicyDescriptor description;
    description.output.frame = frame;
    description.output.anchors = 1;
    description.output.joints_from_neutral = true;
    Pose X_FB = goal.X_WB;
    if (frame == PlanFrame::kEgo) X_FB = ego_frame(now).inverse() * goal.X_WB;
    if (frame == PlanFrame::kDisplacement) X_FB.p -= now.X_WB.p;
    Eigen::Matrix<float, 36, 1> numbers = Eigen::Matrix<float, 36, 1>::Zero();
    numbers.head<3>() = X_FB.p.cast<float>();
    numbers.segment<4>(3) =
        3.0F * Eigen::Vector4d(X_FB.R.w(), X_FB.R.x(), X_FB.R.y(), X_FB.R.z()).cast<float>();  // made unit again
    const DecodedPlan decoded = PlanDecoder(description, g1(), joints).decode({numbers.data(), 36}, now);
    ASSERT_EQ(decoded.references.size(), 1U);
    EXPECT_NEAR((decoded.references[0].X_WB.p - goal.X_WB.p).norm(), 0.0, kFloat) << to_string(frame);
    EXPECT_NEAR(decoded.references[0].X_WB.R.angularDistance(goal.X_WB.R), 0.0, 1e-6) << to_string(frame);
    EXPECT_EQ(decoded.references[0].q, g1()->neutral);
  }
}

std::vector<float> shown(PolicyFrame frame, const std::vector<Channel>& channels, const MovingHistory& history,
                         int index, std::vector<int> joints) {
  const int count = static_cast<int>(joints.size());
  PolicyDescriptor of_the_frame;
  of_the_frame.frame = frame;
  ChannelValues values(g1(), std::move(joints), of_the_frame);
  values.reset(test::episode({.X_WB = {Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3}}, .q = {}, .v = {}}), {});
  std::vector<float> numbers;
  for (const Channel& channel : channels) {
    std::vector<float> part(channel_size(channel, {.joints = count, .actions = 0}));
    values.write(channel, history.at(100), index, part);
    numbers.insert(numbers.end(), part.begin(), part.end());
  }
  return numbers;
}

TEST(PolicyChannels, InTheWorldAreTheVectorOfTheSupplement) {
  const MovingHistory history(4);
  std::vector<int> joints(29);
  for (int i = 0; i < 29; ++i) joints[i] = i;
  for (const int i : {0, 5, 11}) {
    const Eigen::VectorXd vector = to_vector(history.at(0).history[i], {0.1, 0.2, 0.3});
    const std::vector<float> numbers = shown(PolicyFrame::kWorld, frame_channels(), history, i, joints);
    ASSERT_EQ(numbers.size(), static_cast<std::size_t>(vector.size()));
    for (int k = 0; k < vector.size(); ++k) EXPECT_NEAR(numbers[k], vector[k], kFloat) << k;
  }
}

TEST(PolicyChannels, OfTheRobotAreThoseOfDstar) {
  const MovingHistory history(4);
  std::vector<int> joints(29);
  for (int i = 0; i < 29; ++i) joints[i] = i;
  DstarFeatures features;
  FeatureMaker(g1()).make(history.at(0), features);
  const std::vector<Channel> channels = frame_channels(ChannelKind::kJointPosition);
  for (const int i : {0, 5, 11}) {
    const std::vector<float> numbers = shown(PolicyFrame::kEgo, channels, history, i, joints);
    ASSERT_EQ(static_cast<int>(numbers.size()), kFrameSize);
    for (int k = 0; k < kFrameSize; ++k) EXPECT_EQ(numbers[k], features.frames(k, i)) << k;
  }
}

TEST(PolicyChannels, AreInTheDescriptorsOrderScaledAndOffset) {
  const MovingHistory history(6);
  std::vector<int> joints(29);
  for (int i = 0; i < 29; ++i) joints[i] = 28 - i;
  const std::vector<Channel> channels = {{.kind = ChannelKind::kJointVelocity, .scale = {0.5}, .shift = {1.0}},
                                         {.kind = ChannelKind::kTask, .size = 6},
                                         {.kind = ChannelKind::kTime}};
  const std::vector<float> numbers = shown(PolicyFrame::kWorld, channels, history, 3, joints);
  const Eigen::VectorXd& v = history.at(0).history[3].robot.v;
  for (int j = 0; j < 29; ++j) EXPECT_NEAR(numbers[j], 0.5 * (v[28 - j] - 1.0), kFloat);
  EXPECT_EQ((std::vector<float>(numbers.begin() + 29, numbers.end())), (std::vector<float>{0, 0, 0, 1, 0, 0, 2.0F}));
}

// A plan whose x is 1 for the second of the descriptor's tasks.
TEST(OnnxPolicy, IsShownTheTasksOfItsDescriptorAndRefusesOthers) {
  std::vector<float> weights(2 * 36, 0.0F);
  weights[36] = 1.0F;
  std::vector<float> plan(36, 0.0F);
  plan[3] = 1.0F;
  OnnxWriter network;
  network.input("task", {1, 2}).constant("W", {2, 36}, weights).constant("b", {1, 36}, plan);
  network.node("MatMul", {"task", "W"}, {"y"}).node("Add", {"y", "b"}, {"plan"}).output("plan", {1, 36});
  const std::string text = replaced(replaced(descriptor(), "anchors: 5", "anchors: 1"),
                                    "{name: obs, frames: 12, channels: [partner_root]}", "{channels: [task]}");
  const Files files;
  files.write(text + "tasks: [bend, wave]\n", network.bytes());
  const auto policy = make_policy(files.path(), g1());
  const MovingHistory history(1);
  EpisodeContext context = test::episode(history.at(0).now().robot);
  for (const auto& [task, x] : {std::pair{Task::kWave, 1.0}, {Task::kBend, 0.0}}) {
    context.task = task;
    policy->reset(context);
    EXPECT_EQ(policy->plan(history.at(0)).at(0).X_WB.p.x(), x) << to_string(task);
  }
  context.task = Task::kHug;
  EXPECT_SENTENCE(thrown_message<MissingError>([&] { policy->reset(context); }));

  files.write(text, network.bytes());
  EXPECT_SENTENCE(files.refusal());
}

// The sum of x of the partner's root over the frames, the newest one weighing 100: the order of frames shows.
TEST(OnnxPolicy, HistoriesComeInTheOrderAskedFor) {
  MovingHistory history(1);
  for (int i = 0; i < kHistoryFrames; ++i) history.frame(i).partner(0, 0) = i;
  for (const bool newest_first : {false, true}) {
    const Files files;
    std::vector<float> weights(36 * 36, 0.0F);
    weights[0] = 1.0F;  // of the first frame's x for the root's x
    std::vector<float> plan(36, 0.0F);
    plan[3] = 1.0F;
    OnnxWriter network;
    network.input("obs", {1, 36}).constant("W", {36, 36}, weights).constant("b", {1, 36}, plan);
    network.node("MatMul", {"obs", "W"}, {"y"}).node("Add", {"y", "b"}, {"plan"}).output("plan", {1, 36});
    std::string text = replaced(descriptor(), "anchors: 5", "anchors: 1");
    if (newest_first) text = replaced(text, "frames: 12,", "frames: 12, order: newest_first,");
    files.write(text, network.bytes());
    const auto policy = make_policy(files.path(), g1());
    policy->reset(test::episode(history.at(0).now().robot));
    EXPECT_EQ(policy->plan(history.at(0)).at(0).X_WB.p.x(), newest_first ? 11.0 : 0.0);
  }
}

TEST(OnnxPolicy, NoiseAndLanguageRepeatWithTheEpisode) {
  const Files files;
  std::vector<float> weights(36 * 36, 0.0F);
  weights[0] = 1.0F;
  std::vector<float> plan(36, 0.0F);
  plan[3] = 1.0F;
  OnnxWriter network;
  network.input("x_T", {1, 36}).input("language", {1, 768});
  network.constant("W", {36, 36}, weights)
      .constant("b", {1, 36}, plan)
      .constant("zero", {768, 1}, std::vector<float>(768));
  network.node("MatMul", {"x_T", "W"}, {"y"}).node("MatMul", {"language", "zero"}, {"z"});
  network.node("Add", {"y", "b"}, {"s"}).node("Add", {"s", "z"}, {"plan"}).output("plan", {1, 36});
  files.write(
      replaced(replaced(descriptor(), "anchors: 5", "anchors: 1"), "{name: obs, frames: 12, channels: [partner_root]}",
               "{name: x_T, channels: [{channel: noise, size: 36}]}\n  - {name: language, channels: [language]}"),
      network.bytes());
  const PolicyMaker maker = policy_maker(files.path(), g1());
  const MovingHistory history(1);
  const auto first = maker(), second = maker();
  for (const auto* policy : {&first, &second}) (*policy)->reset(test::episode(history.at(0).now().robot));
  double last = 0.0;
  for (const int tick : {0, 10, 20}) {
    const double x = first->plan(history.at(tick)).at(0).X_WB.p.x();
    EXPECT_EQ(second->plan(history.at(tick)).at(0).X_WB.p.x(), x);
    EXPECT_NE(x, last);
    last = x;
  }
}

TEST(OnnxPolicy, CountsPlansThatAreNone) {
  const MovingHistory history(1);
  for (const auto& [place, number, message] :
       {std::tuple{36 + 3, 0.0F, "plan: anchor 1: expected a unit quaternion, found one of length 0"},
        std::tuple{5, INFINITY, ""}}) {
    std::vector<float> plan = standing_plan(5);
    plan[place] = number;
    const Files files;
    if (std::isinf(number)) {  // constants of a file are finite: 1e38 * 1e38 is not
      OnnxWriter network;
      std::vector<float> large(180, 1e38F);
      network.input("obs", {1, 36}).constant("W", {36, 180}, std::vector<float>(36 * 180, 1.0F));
      network.constant("large", {1, 180}, large).node("MatMul", {"obs", "W"}, {"y"});
      network.node("Exp", {"y"}, {"positive"}).node("Add", {"positive", "large"}, {"s"});
      network.node("Mul", {"s", "large"}, {"plan"}).output("plan", {1, 180});
      files.write(descriptor(), network.bytes());
    } else {
      const std::string network = constant_network({{"obs", 36}}, plan);
      files.write(descriptor(), network);
    }
    const auto policy = make_policy(files.path(), g1());
    policy->reset(test::episode(history.at(0).now().robot));
    EXPECT_TRUE(policy->plan(history.at(0)).empty());
    EXPECT_EQ(policy->faults().invalid, 1);
    const std::string expected =
        std::isinf(number) ? "plan: anchor 0, number 0: expected a finite number, found inf" : message;
    EXPECT_EQ(policy->faults().message, "policy 'mine': tick 0: " + expected);
    EXPECT_EQ(policy->act(history.at(10))[0].q, history.at(0).now().robot.q);  // holds the start
    policy->reset(test::episode(history.at(0).now().robot));
    EXPECT_FALSE(policy->faults().any());
  }
}

TEST(OnnxPolicy, IsNotShownNumbersThatAreNotFinite) {
  MovingHistory history(1);
  const Files files;
  const std::string network = constant_network({{"obs", 36}}, standing_plan(5));
  files.write(descriptor(), network);
  const auto policy = make_policy(files.path(), g1());
  policy->reset(test::episode(history.at(0).now().robot));
  history.frame(4).robot.q[3] = std::nan("");
  EXPECT_TRUE(policy->plan(history.at(0)).empty());
  EXPECT_SENTENCE(policy->faults().message);
}

TEST(OnnxPolicy, RefusesANetworkOfOtherPorts) {
  const Files files;
  const std::string small = constant_network({{"obs", 35}}, standing_plan(5));
  files.write(descriptor(), small);
  EXPECT_EQ(files.refusal(), files.path() + ":9: with " + files.network() +
                                 ": input 'obs': expected 35 numbers, found 36 of the channels: partner_root 0..2 (12 "
                                 "frames of 3)");
  const std::string other = constant_network({{"observation", 36}}, standing_plan(5));
  files.write(descriptor(), other);
  EXPECT_SENTENCE(files.refusal());
  const std::string two = constant_network({{"obs", 36}, {"more", 3}}, standing_plan(5));
  files.write(descriptor(), two);
  EXPECT_SENTENCE(files.refusal());
  const std::string four = constant_network({{"obs", 36}}, standing_plan(4));
  files.write(descriptor(), four);
  EXPECT_SENTENCE(files.refusal());
  files.write(replaced(descriptor(), "{anchors: 5}", "{name: plans}"), four);
  EXPECT_SENTENCE(files.refusal());
  files.write(replaced(descriptor(), "{anchors: 5}", "{anchors: 4, scale: [1, 2]}"), four);
  EXPECT_EQ(files.refusal(), files.path() + ":10: output: 'scale': expected 1 or 36 numbers, found 2");
  files.write(replaced(descriptor(), "left_knee_joint", "left_knie_joint"), four);
  EXPECT_SENTENCE(files.refusal());
  files.write(replaced(descriptor(), "mine.onnx", "none.onnx"), four);
  EXPECT_SENTENCE(thrown_message<MissingError>([&] { make_policy(files.path(), g1()); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { make_policy(files.path(), g1(), {{"netwrok", "x"}}); }));
}

}  // namespace
}  // namespace duet
