#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>

namespace tendonfmu {

using json = nlohmann::json;

/* Larger than any finger: 16 joints × 64 tendons × 256 working points with two-sided laws are about 50 MB. */
constexpr std::size_t max_document_bytes = std::size_t{64} << 20;

/* A description has seven levels. */
constexpr std::size_t max_document_depth = 32;

/* Parses a JSON text (RFC 8259, UTF-8, no comments). Throws description_error with line and column of a syntax error,
 * a number beyond the range of a double or a byte that is not UTF-8, or with the path of a key given twice. */
json parse_document(const char* text, std::size_t size);

}  // namespace tendonfmu
