// Any bytes as lines of CiA 309-3: a request or a code, values within their types, and what a value's text says reads
// back to the same bytes.
#include <cmath>

#include "berth/base/base64.hpp"
#include "berth/serve/cia309.hpp"
#include "fuzz/require.hpp"

namespace gateway_309_target {

namespace {

using namespace berth;
using fuzz::require;

void check_value(const serve::cia309::Request& request) {
  const auto size = od::byte_size(request.type.type);
  require(size == 0 || request.data.size() == size);
  const auto text = serve::cia309::value_text(request.type, request.data);
  require(text.has_value() && text->find_first_of("\r\n") == std::string::npos);
  if (od::is_real(request.type.type) &&
      std::isnan(od::real_of(request.type.type, od::load(request.type.type, request.data.data())))) {
    return;
  }
  if (request.type.shown == serve::cia309::Type::Shown::hex_bytes && request.data.empty()) return;
  std::string word(request.type.type == od::DataType::none ? "hex" : od::name(request.type.type));
  for (const auto* const name :
       {"b",   "i8",  "i16", "i24", "i32", "i40", "i48", "i56", "i64", "u8", "u16", "u24", "u32", "u40", "u48",
        "u56", "u64", "r32", "r64", "t",   "td",  "vs",  "os",  "us",  "d",  "x8",  "x16", "x32", "x64"}) {
    if (serve::cia309::type_named(name) == request.type) word = name;
  }
  const auto again = serve::cia309::parse_line("[1] 1 w 0 0 " + word + " " + *text);
  require(!again.error && again.request.data == request.data);
}

void check(std::string_view line) {
  const auto parsed = serve::cia309::parse_line(line);
  if (parsed.error) return require(*serve::cia309::text_of(*parsed.error) != '\0');
  const auto& r = parsed.request;
  require(r.count <= r.numbers.size() && (!r.net || *r.net != 0) && (!r.node || *r.node <= 127));
  require(r.values.size() <= 64 && r.pdo.fields.size() <= 64 && r.pdo.number >= 1 && r.pdo.number <= 512);
  if (r.verb == serve::cia309::Verb::write) check_value(r);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view rest(reinterpret_cast<const char*>(data), size);
  while (!rest.empty()) {
    const auto end = rest.find('\n');
    check(rest.substr(0, end));
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + 1);
  }
  const auto bytes = from_base64({reinterpret_cast<const char*>(data), size});
  if (bytes) require(from_base64(to_base64(*bytes)) == *bytes);
  return 0;
}

}  // namespace gateway_309_target
