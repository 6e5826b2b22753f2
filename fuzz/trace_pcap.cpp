// A classic pcap file's bytes: see trace_stream.hpp.
#include "fuzz/trace_stream.hpp"

namespace trace_pcap_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  berth::fuzz::check(berth::trace::Format::pcap, {reinterpret_cast<const char*>(data), size});
  return 0;
}

}  // namespace trace_pcap_target
