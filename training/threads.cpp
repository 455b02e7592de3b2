#include "duet/training/threads.h"

#include <exception>
#include <thread>
#include <vector>

namespace duet {

void on_threads(int threads, const std::function<void(int)>& f) {
  std::vector<std::exception_ptr> failures(threads);
  const auto guarded = [&](int i) {
    try {
      f(i);
    } catch (...) {
      failures[i] = std::current_exception();
    }
  };
  {
    std::vector<std::jthread> others;
    for (int i = 1; i < threads; ++i) others.emplace_back(guarded, i);
    guarded(0);
  }
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

}  // namespace duet
