// Reports of the guard to its planner, the log of a run read as a recording, and sealed datagrams.
#include <cstring>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/log/run_report.h"
#include "duet/hardware/wire/sealed_datagram.h"
#include "tests/fuzz/reader.h"
#include "tests/hardware/guarded_twin.h"

namespace duet::fuzz {
namespace {

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::span<const std::byte> bytes_in(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::string report_sample(unsigned /*seed*/) {
  ReportBuffer buffer;
  encode(GuardReport(), buffer);
  return text_of(buffer);
}

void read_report(std::string_view bytes) {
  GuardReport report;
  (void)decode(bytes_in(bytes), report);
}

// A few ticks of a guard that runs.
std::string log_sample(unsigned /*seed*/) {
  static const std::string sample = [] {
    test::GuardedTwin robot;
    robot.start();
    robot.message.goal.emplace();
    const std::string path = scratch_folder() + "/sample.mcap";
    std::filesystem::remove(path);
    {
      RunLog log(path, test::twin_guard());
      for (int k = 0; k < 12; ++k) {
        robot.tick();
        log.add(robot.guard);
      }
    }
    return read_file(path);
  }();
  return sample;
}

void read_log(std::string_view bytes) { (void)recording_of_log(scratch_file("fuzz.mcap", bytes)); }

void read_log_report(std::string_view bytes) { (void)report_of_log(scratch_file("fuzz.mcap", bytes)); }

constexpr std::uint64_t kSecret = 1000;

std::string sealed_sample(unsigned seed) {
  SealedBuffer buffer;
  const std::string_view carried = "a plan";
  const SealedHead head{static_cast<SealedKind>(1 + seed % kSealedKinds), 3, SealGate(kSecret).ticket(1.0), 7, 5.0};
  const std::size_t size = seal({}, head, bytes_in(carried), buffer);
  return text_of(std::span<const std::byte>(buffer).first(size));
}

// As it came, and as one who has the key would have sealed it; to a gate that has taken one before.
void read_sealed(std::string_view bytes) {
  SealedHead head;
  std::span<const std::byte> carried;
  (void)unseal({}, bytes_in(bytes), head, carried);
  std::array<std::byte, kSealedHeadBytes> raw{};
  std::memcpy(raw.data(), bytes.data(), std::min(bytes.size(), raw.size()));
  std::memcpy(&head.kind, raw.data() + 4, 2);
  std::memcpy(&head.sender, raw.data() + 6, 2);
  std::memcpy(&head.ticket, raw.data() + 8, 8);
  std::memcpy(&head.sequence, raw.data() + 16, 8);
  std::memcpy(&head.clock, raw.data() + 24, 8);
  SealedBuffer buffer;
  const std::string_view rest = bytes.substr(std::min(bytes.size(), raw.size()));
  const std::size_t size = seal({}, head, bytes_in(rest.substr(0, kMostSealed)), buffer);
  SealGate gate(kSecret);
  for (const double now : {1.2, 1.21, 3.0})
    if (unseal({}, std::span<const std::byte>(buffer).first(size), head, carried) == SealRefusal::kNone)
      (void)gate.takes(head, now);
}

}  // namespace

std::vector<Reader> guard_readers() {
  return {{"guard_report", report_sample, read_report},
          {"sealed_datagram", sealed_sample, read_sealed},
          {"log_recording", log_sample, read_log},
          {"log_report", log_sample, read_log_report}};
}

}  // namespace duet::fuzz
