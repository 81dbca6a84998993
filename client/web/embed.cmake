# Writes a C++ source that holds files. Call: cmake -D OUTPUT=x.cpp "-D FILES=a;b" -P embed.cmake
set(arrays)
set(entries)
set(number 0)
foreach(file ${FILES})
  get_filename_component(name ${file} NAME)
  file(READ ${file} bytes HEX)
  string(LENGTH "${bytes}" length)
  math(EXPR length "${length} / 2")
  # One long literal: compilers take minutes for as many characters in an array's braces.
  string(REGEX REPLACE "(..)" "\\\\x\\1" bytes "${bytes}")
  string(APPEND arrays "constexpr std::string_view kFile${number}(\"${bytes}\", ${length});\n")
  string(APPEND entries "    {\"${name}\", kFile${number}},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE ${OUTPUT} "#include \"client/web/page_files.h\"

namespace cairn::web {
namespace {

${arrays}
constexpr PageFile kFiles[] = {
${entries}};

}  // namespace

std::span<const PageFile> PageFiles() {
  return kFiles;
}

}  // namespace cairn::web
")
