// The maker's services in memory: each request is kept, and answered at once by whoever stands for them.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "duet/hardware/executors/sport_executor.h"

namespace duet::test {

class MemorySport : public SportWire {
 public:
  bool take(RpcResponse& response) final {
    if (waiting_.empty()) return false;
    response = waiting_.front();
    waiting_.pop_front();
    return true;
  }
  bool request(const RpcRequest& request) final {
    requests.push_back(request);
    if (const std::optional<RpcResponse> said = answer(request)) waiting_.push_back(*said);
    return true;
  }

  double now = 0.0;
  std::vector<RpcRequest> requests;

 private:
  // None: nobody answers.
  virtual std::optional<RpcResponse> answer(const RpcRequest& request) = 0;

  std::deque<RpcResponse> waiting_;
};

}  // namespace duet::test
