#include "duet/hardware/dds/twin_over_dds.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <utility>

#include "duet/core/require.h"
#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/twin/lock_step.h"

extern char** environ;

namespace duet {
namespace {

constexpr const char* kLongest = "3600";  // that a twin lives whose owner was killed [s]
constexpr double kPatience = 10.0;        // with the guard: it starts, and a machine is busy [s]

std::vector<std::string> arguments_of(const TwinOverDdsOptions& options) {
  const TwinOptions& twin = options.twin;
  std::vector<std::string> arguments = {"--operated",
                                        "--seconds",
                                        kLongest,
                                        "--domain",
                                        std::to_string(options.place.domain),
                                        "--seed",
                                        std::to_string(twin.seed),
                                        "--mode-machine",
                                        std::to_string(twin.mode_machine)};
  const std::pair<const char*, double> numbers[] = {{"--drift", twin.drift},
                                                    {"--place-noise", twin.place_noise},
                                                    {"--speed-noise", twin.speed_noise},
                                                    {"--joint-noise", twin.joint_noise},
                                                    {"--joint-speed-noise", twin.joint_speed_noise},
                                                    {"--gyro-noise", twin.gyro_noise},
                                                    {"--acceleration-noise", twin.acceleration_noise},
                                                    {"--tilt-noise", twin.tilt_noise}};
  for (const auto& [name, value] : numbers) arguments.insert(arguments.end(), {name, fmt::format("{}", value)});
  if (!twin.engine.empty()) arguments.insert(arguments.end(), {"--physics", twin.engine});
  if (options.lock_step) arguments.emplace_back("--lock-step");
  arguments.insert(arguments.end(), options.more.begin(), options.more.end());
  return arguments;
}

}  // namespace

TwinProcess::TwinProcess(const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {program};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> raw;
  for (std::string& argument : all) raw.push_back(argument.data());
  raw.push_back(nullptr);
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  posix_spawn_file_actions_addopen(&quiet, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  const int error = posix_spawn(&pid_, program.c_str(), &quiet, nullptr, raw.data(), environ);
  posix_spawn_file_actions_destroy(&quiet);
  if (error != 0) throw std::runtime_error(fmt::format("cannot start '{}': {}", program, std::strerror(error)));
}

TwinProcess::~TwinProcess() {
  send(SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void TwinProcess::send(int signal) const { kill(pid_, signal); }

std::string twin_program() {
  std::error_code error;
  const std::filesystem::path beside =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path() / "duet-g1-twin";
  if (!std::filesystem::exists(beside, error))
    throw MissingError(fmt::format("the twin's program is not there: expected '{}'", beside.string()));
  return beside.string();
}

TwinOverDds::TwinOverDds(const TwinOverDdsOptions& options, const GuardSetup& setup, std::unique_ptr<Walker> walker,
                         RunLog* log)
    : process_(std::make_unique<TwinProcess>(options.program, arguments_of(options))),
      wire_(open_robot_wire(options.place)),
      walker_(std::move(walker)),
      socket_(std::make_unique<DatagramSocket>(DatagramSocket::at_path(options.socket))),
      reports_(options.socket),
      link_(std::make_unique<SocketGuardLink>(options.socket, kPatience)) {
  thread_ = std::thread([this, setup, log, lock_step = options.lock_step] {
    try {
      run_thread(setup, log, lock_step);
    } catch (...) {
      failure_ = std::current_exception();
      failed_ = true;
    }
  });
}

TwinOverDds::~TwinOverDds() {
  ends_ = true;
  (void)link_->stop();  // a guard in lock-step waits for somebody to speak
  thread_.join();
}

void TwinOverDds::run_thread(const GuardSetup& setup, RunLog* log, bool lock_step) {
  if (lock_step)
    ask_for_sharp_timers();
  else
    (void)ask_for_real_time();
  LockStepWire stepped(*wire_);
  RobotWire& wire = lock_step ? static_cast<RobotWire&>(stepped) : *wire_;
  RobotGuard guard(setup, wire, nobody_);
  if (walker_ != nullptr) guard.let_walk(*walker_);
  bool armed = false;
  const auto after = [&](double) {
    if (log != nullptr) log->add(guard);
    if (guard.status().safety.state == SafetyState::kReady && !std::exchange(armed, true)) guard.arm();
    return !ends_;
  };
  if (lock_step)
    run_guard_in_lock_step(guard, stepped, socket_.get(), setup.limiter.dt,
                           {after, [&] { return reports_.after_tick(guard); }});
  else
    run_guard(guard, wire, socket_.get(), setup.limiter.dt, [&](double now) {
      (void)reports_.after_tick(guard);
      return after(now);
    });
}

bool TwinOverDds::next(GuardReport& report) {
  const bool came = link_->next(report);
  if (!came && failed_) std::rethrow_exception(failure_);
  return came;
}

}  // namespace duet
