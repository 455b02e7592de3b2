// Where this module lies: duet's suites, robots and engines are looked for beside it (core/share.h).
#include <dlfcn.h>

extern "C" __attribute__((visibility("default"))) const char* duet_module_file();

extern "C" const char* duet_module_file() {
  static const char* const file = [] {
    Dl_info info{};
    return dladdr(reinterpret_cast<const void*>(&duet_module_file), &info) != 0 ? info.dli_fname : "";
  }();
  return file;
}
