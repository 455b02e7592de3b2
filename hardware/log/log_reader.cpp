#include "duet/hardware/log/log_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/hardware/log/frame_cdr.h"
#include "duet/hardware/safety/limiter_setup_json.h"

namespace duet {
namespace {

constexpr long kMostCounted = 1'000'000'000'000;  // of an event: sums stay far below what a number holds

class LogMessages {
 public:
  LogMessages(const std::string& path, const LogParts& parts) : path_(path), parts_(parts) {}

  void take(const McapChannel& channel, const McapMessage& message) {
    const std::string_view text(reinterpret_cast<const char*>(message.data.data()), message.data.size());
    if (channel.topic == "guard/setup") return take_setup(text);
    if (channel.topic == "guard/tick") return take_tick(channel, message.data);
    if (channel.topic == "rt/lowstate") return take_frame("states", message.data, parts_.state);
    if (channel.topic == "rt/lowcmd") return take_frame("commands", message.data, parts_.command);
    if (channel.topic == "guard/events") return take_event(text, 1e-9 * static_cast<double>(message.time));
    if (channel.topic == "guard/health" && parts_.health) parts_.health(parse_health(text, path_));
  }
  [[nodiscard]] bool has_setup() const { return has_setup_; }

 private:
  void take_setup(std::string_view text) {
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("limiter"))
      throw InputError(fmt::format("{}: expected the setup of a limiter, found none", path_));
    has_setup_ = true;
    if (parts_.setup) parts_.setup(parse_limiter_setup(json["limiter"], path_), json);
  }

  void take_tick(const McapChannel& channel, std::span<const std::byte> data) {
    if (channel.message_encoding != kTickEncoding)
      throw InputError(fmt::format("{}: expected ticks of the form '{}', found '{}', which this version cannot read",
                                   path_, kTickEncoding, excerpt(channel.message_encoding)));
    if (!has_setup_ || data.size() != sizeof(TickRecord))
      throw InputError(fmt::format("{}: expected a setup and ticks of {} bytes, found {} bytes{}", path_,
                                   sizeof(TickRecord), data.size(), has_setup_ ? "" : " and no setup"));
    TickRecord record;
    std::memcpy(&record, data.data(), sizeof(record));
    if (parts_.tick) parts_.tick(record);
  }

  template <typename Frame>
  void take_frame(const char* what, std::span<const std::byte> data, const std::function<void(const Frame&)>& part) {
    if (!part) return;
    Frame frame;
    if (!read_cdr(data, frame))
      throw InputError(
          fmt::format("{}: expected {} of {} bytes of CDR, found {}", path_, what, kCdrBytes<Frame>, data.size()));
    part(frame);
  }

  void take_event(std::string_view text, double time) {
    const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
    const auto word = [&](const char* name) {
      const nlohmann::json value = json.is_object() ? json.value(name, nlohmann::json()) : nlohmann::json();
      if (!value.is_string())
        throw InputError(fmt::format("{}: expected events with a state and a cause, found others", path_));
      return value.get<std::string>();
    };
    const auto number = [&](const char* name) {
      const nlohmann::json value = json.value(name, nlohmann::json());
      return value.is_number_integer() ? std::clamp(value.get<long>(), 0L, kMostCounted) : 0L;
    };
    LogEvent event{time, word("state"), word("cause"), 0, 0, std::string(text)};
    event.dropped = number("dropped");
    event.restarts = number("restarts");
    event.refused = number("refused");
    event.kept_out = number("kept_out");
    if (event.refused > 0 || event.kept_out > 0) event.why = word("why");
    if (parts_.event) parts_.event(event);
  }

  const std::string& path_;
  const LogParts& parts_;
  bool has_setup_ = false;
};

}  // namespace

bool read_run_log(const std::string& path, const LogParts& parts) {
  const std::string bytes = read_file(path);
  LogMessages messages(path, parts);
  const bool whole =
      read_mcap(std::as_bytes(std::span(bytes)), path, [&](const McapChannel& channel, const McapMessage& message) {
        messages.take(channel, message);
      }).whole;
  if (!messages.has_setup())
    throw InputError(fmt::format("{}: expected the log of a run, found an MCAP file without one", path));
  return whole;
}

}  // namespace duet
