from .demo import Story as Story
from .page import write_story as write_story
from .report import story_report as story_report
from .text import chapter_lines as chapter_lines
from .text import chapter_tables as chapter_tables
from .text import file_lines as file_lines
