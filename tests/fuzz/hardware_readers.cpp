// Bytes that reach the guard of a real robot from outside: messages of sockets and topics, configurations, logs.
#include <fmt/format.h>

#include <cstring>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/hardware/executors/sport_executor.h"
#include "duet/hardware/guard/camera_calibration.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/guard/person_log.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/log/guard_health.h"
#include "duet/hardware/log/limiter_replay.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/safety/checklist.h"
#include "duet/hardware/safety/limiter_setup_json.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/hardware/wire/odometry_source.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

std::span<const std::byte> datagram(std::string_view bytes) { return std::as_bytes(std::span(bytes)); }

template <typename Buffer>
std::string text_of(const Buffer& buffer, std::size_t size) {
  return {reinterpret_cast<const char*>(buffer.data()), size};
}

void refuse_unless(bool taken) {
  if (!taken) throw InputError("refused");
}

// LCM: each of the four messages.
std::string lcm_sample(unsigned seed) {
  LcmBuffer buffer;
  switch (seed / 64 % 4) {
    case 0:
      return text_of(buffer, encode(PedalCommand{{0.2, 0.0, 0.1, 0.74}}, seed, buffer));
    case 1:
      return text_of(buffer, encode(ArmAction{}, seed, buffer));
    case 2:
      return text_of(buffer, encode(PdTargets{}, seed, buffer));
    default:
      return text_of(buffer, encode(BodyControlData{}, seed, buffer));
  }
}

void read_lcm(std::string_view bytes) {
  PedalCommand pedal;
  ArmAction arms;
  PdTargets targets;
  BodyControlData body;
  FakeHomie homie;
  homie.receive(datagram(bytes), 1.0);
  refuse_unless(decode(datagram(bytes), pedal).refusal.empty() || decode(datagram(bytes), arms).refusal.empty() ||
                decode(datagram(bytes), targets).refusal.empty() || decode(datagram(bytes), body).refusal.empty());
}

std::string guard_sample(unsigned seed) {
  GuardBuffer buffer;
  PlannerMessage planner;
  planner.command.q.setZero(kG1Motors);
  planner.sequence = seed;
  if (seed / 64 % 3 == 0) return text_of(buffer, encode(planner, buffer));
  if (seed / 64 % 3 == 1) return text_of(buffer, encode(PersonMessage{}, buffer));
  return text_of(buffer, encode_stop(buffer));
}

void read_guard(std::string_view bytes) {
  GuardMessage message;
  refuse_unless(decode(datagram(bytes), message) != GuardMessageKind::kRefused);
}

// A track of them: the joints of every body that is taken are used.
std::string person_sample(unsigned seed) {
  PersonEstimate estimate;
  estimate.sequence = seed;
  estimate.seen = seed / 64 % 2 == 0;
  estimate.latency = 0.01 * (seed % 20);
  for (int j = 0; j < kSmplJoints; ++j) estimate.joints.col(j) = Eigen::Vector3d(0.01 * j, -0.02 * j, 3.0);
  PersonBuffer buffer;
  encode(estimate, buffer);
  if (seed % 3 > 0) return text_of(buffer, buffer.size());
  std::string first = text_of(buffer, kFirstPersonBytes);  // of the form of before, and one of today's behind it
  first[3] = '1';
  return first + text_of(buffer, buffer.size());
}

void read_person(std::string_view bytes) {
  PersonEstimate estimate;
  PersonPlacer placer({});
  PersonMessage message;
  PersonTrack track;
  placer.base({}, 1.0);
  bool taken = false;
  for (const RecordedEstimate& one : parse_person_log(bytes, "x")) {
    if (decode(datagram(one.bytes), estimate) != PersonFault::kNone) continue;
    taken = true;
    const double now = 1.0 + one.at;
    if (placer.place(estimate, now, message) != PersonFault::kNone) continue;
    track.add(message.joints, now - message.latency, now);
    (void)track.at(now + 0.05, message.joints);
  }
  refuse_unless(taken);
}

std::string external_sample(unsigned seed) {
  ExternalPoseBuffer buffer;
  encode(ExternalPose{.sequence = seed, .X_WB = {}, .v_WB = Eigen::Vector3d::Zero(), .valid = true}, buffer);
  return text_of(buffer, buffer.size());
}

void read_external(std::string_view bytes) {
  ExternalPose pose;
  refuse_unless(decode(datagram(bytes), pose));
}

std::string state_sample(unsigned seed) {
  LowStateFrame frame{};
  frame.tick = seed + 1;
  frame.imu.quaternion[0] = 1.0f;
  seal(frame);
  return {reinterpret_cast<const char*>(&frame), sizeof(frame)};
}

// Its checksum is made right, so that what is behind it is read too.
void read_low_state(std::string_view bytes) {
  LowStateFrame frame{};
  std::memcpy(&frame, bytes.data(), std::min(bytes.size(), sizeof(frame)));
  seal(frame);
  RobotReading reading;
  refuse_unless(read_state(frame, reading) == FrameFault::kNone && bytes.size() == sizeof(frame));
}

std::string sport_sample(unsigned seed) {
  if (seed / 64 % 2 == 0) return R"({"data":500})";
  return velocity_request(1, {0.2, 0.0, 0.1, 0.0}, 0.3).parameter.data();
}

void read_sport(std::string_view bytes) {
  const bool order = order_of(ServiceCall::kSetVelocity, bytes).has_value();
  refuse_unless(order || fsm_of(bytes).has_value() || name_of(bytes).has_value());
}

std::string config_sample(unsigned seed) {
  constexpr const char* kExamples[] = {"twin", "homie", "sport", "camera"};
  return read_file(std::string(DUET_SOURCE_DIR "/examples/hardware/") + kExamples[seed / 64 % std::size(kExamples)] +
                   ".yaml");
}

void read_config(std::string_view bytes) { (void)parse_robot_config(std::string(bytes), "fuzz.yaml"); }

RobotConfig twin_config() { return parse_robot_config(config_sample(0), "twin.yaml"); }

std::string setup_sample(unsigned seed) {
  RobotConfig config = twin_config();
  config.person = seed / 64 % 2 == 1;
  return limiter_setup_json(guard_setup(config, true).limiter).dump();
}

void read_setup(std::string_view bytes) {
  const nlohmann::json json = nlohmann::json::parse(bytes, nullptr, false);
  if (json.is_discarded()) throw InputError("fuzz: not JSON");
  (void)parse_limiter_setup(json, "fuzz.json");
}

// A wire on which nothing ever comes.
class SilentWire final : public FrameTransport {
 public:
  bool take(LowStateFrame&) override { return false; }
  int foreign_writers() override { return 0; }
  void open_writer() override {}
  void close_writer() override {}
  [[nodiscard]] bool has_writer() const override { return false; }
  bool write(const LowCommandFrame&) override { return false; }
};

class SilentVelocity final : public VelocitySink {
 public:
  void send(const VelocityCommand&) override {}
};

std::string make_log() {
  const std::string path = scratch_folder() + "/made.mcap";
  std::remove(path.c_str());
  const GuardSetup setup = guard_setup(twin_config(), true);
  SilentWire wire;
  SilentVelocity velocity;
  RobotGuard guard(setup, wire, velocity);
  {
    RunLog log(path, setup);
    for (int k = 1; k <= 3; ++k) {
      guard.tick(0.002 * k);
      log.add(guard);
    }
  }
  return read_file(path);
}

std::string log_sample(unsigned) {
  static const std::string log = make_log();
  return log;
}

void read_log(std::string_view bytes) { (void)replay_log(scratch_file("fuzz.mcap", bytes)); }

std::string health_sample(unsigned seed) {
  HealthMessage message;
  message.health.charge = seed;
  message.missing = "remote_age";
  return health_json(message).dump();
}

void read_health(std::string_view bytes) { (void)parse_health(bytes, "x"); }

// Three places and the log of who stood there, in the frame of the base.
std::string calibration_sample(unsigned seed) {
  constexpr double kMarks[][2] = {{1.5, 0.0}, {2.5, 0.8}, {2.5, -0.8}};
  std::string yaml = "schema: duet.calibration/1\nlog: person.dpj\nheight: 0.74\nplaces:\n";
  std::vector<RecordedEstimate> log;
  for (const auto& [ahead, left] : kMarks) {
    const double begin = 0.1 * static_cast<double>(log.size());
    yaml += fmt::format("  - {{at: [{}, {}], seconds: [{:.2f}, {:.2f}]}}\n", ahead, left, begin - 0.05, begin + 0.45);
    for (int k = 0; k < 5; ++k) {
      PersonEstimate estimate{.sequence = log.size() + 1, .stamp = 0.1 * static_cast<double>(log.size()), .seen = true};
      estimate.joints.colwise() = Eigen::Vector3d(ahead, left + 1e-3 * (seed % 5), -0.66);
      log.push_back(recorded(estimate));
    }
  }
  return yaml + std::string(kSeparator) + person_log(log);
}

void read_calibration(std::string_view bytes) {
  const std::vector<std::string_view> files = parts(bytes, 2);
  scratch_file("person.dpj", files[1]);
  const CameraCalibration found = calibrate_camera(read_marked_places(scratch_file("places.yaml", files[0])), "x");
  if (!found.X_BC.p.allFinite() || !std::isfinite(found.rms)) throw std::logic_error("a camera that is nowhere");
}

// Filled in up to an item.
std::string checklist_sample(unsigned seed) {
  std::string text = empty_checklist("E21-1", std::string(64, 'a'), std::string(64, 'b'), 1795860900.0);
  const std::vector<std::string> names = checklist_names();
  text.replace(text.find("who: \"\""), 7, "who: A. Name");
  for (std::size_t k = 0; k < std::min<std::size_t>(seed / 64 + 1, names.size()); ++k) {
    const std::size_t done = text.find("no", text.find(names[k] + ": {"));
    text.replace(done, 2, "yes");
    if (const std::size_t value = text.find("\"\"", done); value < text.find('\n', done))
      text.insert(value + 1, "41.5");
  }
  return text;
}

void read_checklist_form(std::string_view bytes) {
  (void)dumped(checklist_json(parse_checklist(std::string(bytes), "form.yaml")));  // as a log keeps it
}

}  // namespace

std::vector<Reader> hardware_readers() {
  return {{"lcm_message", lcm_sample, read_lcm},
          {"guard_message", guard_sample, read_guard},
          {"person_estimate", person_sample, read_person},
          {"external_pose", external_sample, read_external},
          {"low_state", state_sample, read_low_state},
          {"sport_answer", sport_sample, read_sport},
          {"robot_config", config_sample, read_config},
          {"limiter_setup", setup_sample, read_setup},
          {"guard_health", health_sample, read_health},
          {"run_log", log_sample, read_log},
          {"calibration", calibration_sample, read_calibration},
          {"checklist", checklist_sample, read_checklist_form}};
}

}  // namespace duet::fuzz
