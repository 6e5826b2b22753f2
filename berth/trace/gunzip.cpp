#include "berth/trace/gunzip.hpp"

#include <zlib.h>

#include <array>
#include <new>

namespace berth::trace {

struct Gunzip::State {
  z_stream stream{};
  std::uint64_t in = 0;
  std::uint64_t out = 0;
  bool member_over = false;
  std::array<char, 1U << 16U> piece{};
};

bool is_gzip(std::string_view head) noexcept { return head.starts_with("\x1F\x8B\x08"); }

Gunzip::Gunzip() : state_(std::make_unique<State>()) {
  constexpr int gzip_only = 16 + MAX_WBITS;
  // Without memory, it fails like any other allocation.
  if (inflateInit2(&state_->stream, gzip_only) != Z_OK) throw std::bad_alloc();
}

Gunzip::~Gunzip() { inflateEnd(&state_->stream); }

bool Gunzip::whole() const noexcept { return state_->member_over; }

std::string Gunzip::feed(std::string_view bytes, const std::function<void(std::string_view)>& out) {
  State& s = *state_;
  s.in += bytes.size();
  s.stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib reads it only
  s.stream.avail_in = static_cast<uInt>(bytes.size());
  bool full = false;  // more may come out without more going in
  while (s.stream.avail_in > 0 || full) {
    if (s.member_over) {
      inflateReset(&s.stream);
      s.member_over = false;
    }
    s.stream.next_out = reinterpret_cast<Bytef*>(s.piece.data());
    s.stream.avail_out = static_cast<uInt>(s.piece.size());
    const int state = inflate(&s.stream, Z_NO_FLUSH);
    if (state == Z_BUF_ERROR) return {};
    if (state != Z_OK && state != Z_STREAM_END) return "the gzip file is damaged from here on";
    const std::size_t got = s.piece.size() - s.stream.avail_out;
    s.out += got;
    if (s.out > unsuspicious && s.out / most_growth > s.in)
      return "it unpacks to more than 300 times its bytes: no log does";
    if (got > 0) out({s.piece.data(), got});
    s.member_over = state == Z_STREAM_END;
    full = s.stream.avail_out == 0 && !s.member_over;
  }
  return {};
}

}  // namespace berth::trace
