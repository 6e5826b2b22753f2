// Any bytes as the address of a broker, and as a file with a user and a password: a value within its limits, or words,
// which never repeat a password.
#include <string>
#include <string_view>

#include "berth/mqtt/login.hpp"
#include "berth/mqtt/where.hpp"
#include "fuzz/require.hpp"

namespace mqtt_words_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using fuzz::require;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto where = mqtt::parse_where(text)) {
    require(!where->host.empty() && where->port != 0 && where->host.size() <= 254);
    require(text.find('@') == std::string_view::npos);
    require(mqtt::parse_where(mqtt::to_string(*where)) == *where);
  } else {
    require(!where.error().empty());
    if (text.find('@') != std::string_view::npos) require(where.error().starts_with("an address of a broker"));
  }
  if (const auto login = mqtt::parse_login(text)) {
    require(!login->user.empty() && text.starts_with(login->user));
    require(text.find(login->password, login->user.size()) != std::string_view::npos);
    require(login->password.find('\n') == std::string::npos && login->user.find('\n') == std::string::npos);
    require(login->user.find('\0') == std::string::npos && login->password.find('\0') == std::string::npos);
  } else {
    require(login.error().size() < 100 && login.error().substr(1, 2) == ": ");
  }
  return 0;
}

}  // namespace mqtt_words_target
