#include <ctime>
#include <limits>

#include "duet/core/require.h"
#include "duet/retarget/pair.h"
#include "duet/retarget/pair_solver.h"

namespace duet {

namespace {

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <typename Action>
double least_seconds(int rounds, const Action& action) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < rounds; ++i) {
    const double begin = thread_seconds();
    action();
    least = std::min(least, thread_seconds() - begin);
  }
  return least;
}

}  // namespace

PairTiming time_pair(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options, int rounds) {
  require(rounds > 0, "time_pair: expected at least one round");
  InteractionClip resampled = clip;
  resampled.a = resample(clip.a, 50.0);
  resampled.b = resample(clip.b, 50.0);
  const PairProblem problem = make_pair_problem(resampled, robot, options);
  PairTiming timing;
  timing.frames = problem.frames();
  timing.kernel = choose_kernel(problem, options);
  timing.solver = timing.frames / least_seconds(rounds, [&] { static_cast<void>(solve_pair(problem, options)); });
  timing.whole = timing.frames / least_seconds(rounds, [&] { static_cast<void>(retarget(clip, robot, options)); });
  return timing;
}

}  // namespace duet
