/// Passes whole blocks of bytes from one thread to another, also of another process: three buffers and one atomic word,
/// in memory that both share. Only the word decides whose each buffer is, so either side may be killed at any
/// instruction and be restarted: a block that was not passed completely was not passed.
///
///     Giver giver(memory, layout);               Taker taker(memory, layout);
///     giver.work()[5] = 1;                       if (taker.take()) use(taker.taken());
///     giver.give();
///
/// Neither side waits, locks or uses the heap after its constructor. Each side belongs to one thread.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace berth::process {

/// Significant bytes of a block: a block may be large and mostly empty.
struct Run {
  std::uint32_t at = 0;
  std::uint32_t size = 0;
};

struct BlockLayout {
  std::uint32_t size = 0;
  std::vector<Run> runs;

  static constexpr std::size_t line = 64;  ///< bytes that a processor moves at once
  [[nodiscard]] static constexpr std::size_t up(std::size_t bytes) noexcept { return (bytes + line - 1) / line * line; }
  [[nodiscard]] std::size_t buffer() const noexcept { return up(size); }
  /// Bytes that an exchange of such blocks needs, at a multiple of `line`.
  [[nodiscard]] std::size_t memory() const noexcept { return line + 3 * buffer(); }
};

/// The word: which buffer belongs to the giver, which to the taker, which is between them, and whether that is newer
/// than the taker's. Another process writes this memory: an invalid index of 3 counts as 0.
class Owners {
 public:
  static constexpr std::uint32_t initial = 0U | 1U << 2U | 2U << 4U;  ///< giver, between, taker
  static constexpr std::uint32_t fresh = 1U << 6U;
  using Word = std::atomic<std::uint32_t>;
  static_assert(Word::is_always_lock_free, "the word is shared by processes");

  [[nodiscard]] static std::size_t giver(std::uint32_t word) noexcept { return (word & 3U) % 3U; }
  [[nodiscard]] static std::size_t taker(std::uint32_t word) noexcept { return (word >> 4U & 3U) % 3U; }
  /// Swaps the giver's buffer and the one between.
  [[nodiscard]] static std::uint32_t given(std::uint32_t word) noexcept {
    return (word & 3U) << 2U | (word >> 2U & 3U) | (word & 0x30U) | fresh;
  }
  /// Swaps the taker's buffer and the one between.
  [[nodiscard]] static std::uint32_t taken(std::uint32_t word) noexcept {
    return (word & 3U) | (word >> 4U & 3U) << 2U | (word >> 2U & 3U) << 4U;
  }
};

class Giver {
 public:
  /// `memory`: `layout.memory()` bytes, which must stay; its word was set to `Owners::initial` once.
  Giver(std::uint8_t* memory, BlockLayout layout)
      : word_(reinterpret_cast<Owners::Word*>(memory)),
        buffers_(memory + BlockLayout::line),
        layout_(std::move(layout)),
        work_(layout_.size) {}
  Giver(const Giver&) = delete;
  Giver& operator=(const Giver&) = delete;

  /// The block that the next `give` passes. Its content stays afterwards.
  [[nodiscard]] std::span<std::uint8_t> work() noexcept { return work_; }
  void give() noexcept {
    auto word = word_->load(std::memory_order_relaxed);
    auto* const to = buffers_ + Owners::giver(word) * layout_.buffer();
    for (const auto& run : layout_.runs) std::memcpy(to + run.at, work_.data() + run.at, run.size);
    while (!word_->compare_exchange_weak(word, Owners::given(word), std::memory_order_acq_rel)) {
    }
  }

 private:
  Owners::Word* word_;
  std::uint8_t* buffers_;
  BlockLayout layout_;
  std::vector<std::uint8_t> work_;
};

class Taker {
 public:
  /// As `Giver`.
  Taker(std::uint8_t* memory, const BlockLayout& layout)
      : word_(reinterpret_cast<Owners::Word*>(memory)),
        buffers_(memory + BlockLayout::line),
        buffer_(layout.buffer()),
        size_(layout.size),
        front_(Owners::taker(word_->load(std::memory_order_acquire))) {}
  Taker(const Taker&) = delete;
  Taker& operator=(const Taker&) = delete;

  /// True when a newer block came; `taken` is that block until the next `take`.
  bool take() noexcept {
    auto word = word_->load(std::memory_order_relaxed);
    if ((word & Owners::fresh) == 0) return false;
    while (!word_->compare_exchange_weak(word, Owners::taken(word), std::memory_order_acq_rel)) {
    }
    front_ = Owners::taker(Owners::taken(word));
    return true;
  }
  [[nodiscard]] std::span<const std::uint8_t> taken() const noexcept { return {buffers_ + front_ * buffer_, size_}; }

 private:
  Owners::Word* word_;
  const std::uint8_t* buffers_;
  std::size_t buffer_;
  std::size_t size_;
  std::size_t front_;
};

}  // namespace berth::process
