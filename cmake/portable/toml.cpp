// toml++ as a static library, which Debian does not have (cmake/Portable.cmake).
#define TOML_IMPLEMENTATION
#include <toml++/toml.h>
