#include "duet/hardware/log/limiter_replay.h"

#include <fmt/format.h>

#include <cstring>
#include <optional>
#include <stdexcept>

#include "duet/core/require.h"
#include "duet/hardware/log/log_reader.h"

namespace duet {
namespace {

bool same_bits(const double* a, const double* b, std::size_t count) {
  return std::memcmp(a, b, count * sizeof(double)) == 0;
}

bool same_output(const TickRecord& record, const LimitedCommand& out) {
  const double root[4] = {out.root.forward, out.root.lateral, out.root.yaw_rate, out.root.height};
  return same_bits(root, record.sent_root, 4) && same_bits(out.q.data(), record.sent_q, kG1Motors) &&
         same_bits(out.kp.data(), record.sent_kp, kG1Motors) && same_bits(out.kd.data(), record.sent_kd, kG1Motors);
}

Limiter limiter_of(const LimiterSetup& setup, const std::string& name) {
  try {
    return Limiter(setup);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("{}: {}", name, error.what()));
  }
}

}  // namespace

LimiterReplay::LimiterReplay(const LimiterSetup& setup, const std::string& name)
    : limiter_(limiter_of(setup, name)), state_(limiter_.start(setup.robot->standing_state())) {
  input_.state = setup.robot->standing_state();
}

bool LimiterReplay::agrees(const TickRecord& record) {
  read_record(record, input_, person_, command_);
  if ((record.flags & kTickRestarted) != 0) {
    restart_ = Eigen::Map<const Eigen::VectorXd>(record.restart_q, kG1Motors);
    limiter_.restart(restart_, state_);
  }
  clamps_ = {};
  limiter_.tick((record.flags & kTickReceived) != 0 ? &command_ : nullptr, input_, state_, out_, clamps_);
  return same_output(record, out_);
}

LogReplay replay_log(const std::string& path) {
  LogReplay replay;
  std::optional<LimiterReplay> limiter;
  LogParts parts;
  parts.setup = [&](const LimiterSetup& setup, const nlohmann::json&) { limiter.emplace(setup, path); };
  parts.tick = [&](const TickRecord& record) {
    ++replay.ticks;
    replay.different += limiter->agrees(record) ? 0 : 1;
  };
  parts.event = [&](const LogEvent& event) {
    replay.events.push_back(event.text);
    replay.dropped += event.dropped;
  };
  replay.whole = read_run_log(path, parts);
  return replay;
}

}  // namespace duet
