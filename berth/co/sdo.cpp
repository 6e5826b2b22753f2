#include "berth/co/sdo.hpp"

namespace berth::co {

std::string_view SdoValue::text() const noexcept {
  const auto all = bytes();
  const std::string_view text(static_cast<const char*>(static_cast<const void*>(all.data())), all.size());
  return text.substr(0, text.find('\0'));
}

}  // namespace berth::co
