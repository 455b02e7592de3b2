// The module duet._duet (docs/using-duet.md).
#include <dlfcn.h>
#include <pybind11/pybind11.h>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/python/bindings.h"

PYBIND11_MODULE(_duet, module) {
  namespace py = pybind11;
  module.doc() = "The C++ half of the package duet.";
  module.attr("__version__") = duet::duet_version();
  py::register_exception<duet::InputError>(module, "InputError", PyExc_ValueError);
  py::register_exception<duet::StorageError>(module, "StorageError", PyExc_OSError);
  py::register_exception<duet::MissingError>(module, "MissingError", PyExc_RuntimeError);
  duet::python::add_plans(module);
  duet::python::add_evaluation(module);
  duet::python::add_archive(module);
  duet::python::add_environment(module);
}

extern "C" __attribute__((visibility("default"))) const char* duet_module_file();

extern "C" const char* duet_module_file() {
  static const char* const file = [] {
    Dl_info info{};
    return dladdr(reinterpret_cast<const void*>(&duet_module_file), &info) != 0 ? info.dli_fname : "";
  }();
  return file;
}
