#include "duet/core/read_observer.h"

namespace duet {

ReadObserver& read_observer() {
  thread_local ReadObserver observer = nullptr;
  return observer;
}

}  // namespace duet
