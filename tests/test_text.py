"""Transcripts to words: real cases, and any text at all."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from animeme_stages.align.language import language, languages
from animeme_stages.align.text import tokens

# Those with a reader are in test_languages.py: the reader is an extra.
LANGUAGES = tuple(tag for tag in languages() if not language(tag).reader)


def words(text: str, tag: str) -> str:
    return " ".join(token.text for token in tokens(text, language(tag)))


REAL: dict[str, list[tuple[str, str]]] = {
    "en": [
        ("", ""),
        (" \t\n", ""),
        ("Hello, World!", "hello world"),
        ("HELLO", "hello"),
        ("don't", "don't"),
        ("Don’t", "don't"),
        ("it´s", "it's"),
        ("“Quoted,” she said — twice…", "quoted she said twice"),
        ("‘single’ quotes", "single quotes"),
        ("dogs' 'n' cats", "dogs n cats"),
        ("rock-n-roll", "rock n roll"),
        ("snake_case", "snake case"),
        ("either/or", "either or"),
        ("www.example.com", "www example com"),
        ("12", "twelve"),
        ("0", "zero"),
        ("A1 b2", "a one b two"),
        ("COVID-19", "covid nineteen"),
        ("1,000", "one thousand"),
        ("1,234,567", "one million two hundred and thirty four thousand"
         " five hundred and sixty seven"),
        ("3.5", "three point five"),
        ("0.25", "zero point two five"),
        ("3.14159", "three point one four one five nine"),
        ("1,000.5", "one thousand point five"),
        ("12345678901234567890", "one two three four five six seven eight nine zero"
         " one two three four five six seven eight nine zero"),
        ("50%", "fifty percent"),
        ("R&D", "r and d"),
        ("a+b=c", "a plus b equals c"),
        ("me@home", "me at home"),
        ("20 °", "twenty degrees"),
        ("[laughs] Oh, <break time='1s'/>no [sighs]", "oh no"),
        ("<b>bold</b>", "bold"),
        ("a < b", "a b"),
        ("[unclosed word", "unclosed word"),
        ("café naïve Zoë", "café naïve zoë"),
        ("cafe\u0301 Zoe\u0308", "café zoë"),
        ("hi 😀 there 👩‍👩‍👧", "hi there"),
        ("a\0b\x1bc", "a b c"),
        ("zero\u200bwidth", "zero width"),
        ("\ufefffirst", "first"),
        ("１２", "twelve"),
        ("10:30", "ten thirty"),
        ("10:05", "ten oh five"),
        ("10:00", "ten o'clock"),
        ("1 km", "one kilometer"),
        ("5 kg", "five kilograms"),
        ("20 °C", "twenty degrees celsius"),
        ("$3.50", "three dollars fifty"),
        ("$5 million", "five million dollars"),
        ("5 million", "five million"),
        ("1 €", "one euro"),
        ("Mr. and Mrs. Smith", "mister and missus smith"),
        ("e.g. this", "for example this"),
        ("2026-11-22", "november twenty second twenty twenty six"),
        # A leading zero is part of what is said.
        ("007", "zero zero seven"),
        ("1.0", "one point zero"),
        ("99999999999999999999.5", "nine " * 20 + "point five"),
        # A soft hyphen only marks where a line may break.
        ("de\u00advice", "device"),
        # No composed form exists, and it still is one word.
        ("x\u030cyz", "x\u030cyz"),
    ],
    "de": [
        ("Straße", "straße"),
        ("Größe über Öl", "größe über öl"),
        ("U\u0308ber", "über"),
        ("12", "zwölf"),
        ("21", "einundzwanzig"),
        ("1.000", "eintausend"),
        ("3,5", "drei komma fünf"),
        ("0,25", "null komma zwei fünf"),
        ("50 %", "fünfzig prozent"),
        ("10 €", "zehn euro"),
        ("„Zitat“ »auch« ‚so‘", "zitat auch so"),
        ("E-Mail-Adresse", "e mail adresse"),
        ("Geht’s gut?", "geht's gut"),
        ("1.000,5", "eintausend komma fünf"),
        ("1.234.567,25", "eine million zweihundertvierunddreißigtausendfünfhundertsiebenundsechzig"
         " komma zwei fünf"),
        ("007", "null null sieben"),
        ("1 km", "ein kilometer"),
        ("3,50 €", "drei euro fünfzig"),
        ("um 10:30 Uhr", "um zehn uhr dreißig"),
        ("z. B. Dr. Maier", "zum beispiel doktor maier"),
        ("z.B. hier", "zum beispiel hier"),
        ("am 3. Mai", "am dritten mai"),
        ("2024-10-03", "dritter oktober zweitausendvierundzwanzig"),
    ],
    "es": [
        ("¿Qué tal, señor?", "qué tal señor"),
        ("¡Ñandú!", "ñandú"),
        ("12", "doce"),
        ("21", "veintiuno"),
        ("31 pollos", "treinta y uno pollos"),
        ("1.000", "mil"),
        ("50 %", "cincuenta por ciento"),
        ("3,5", "tres coma cinco"),
        ("1.000,5", "mil coma cinco"),
        ("007", "cero cero siete"),
        ("3,50 €", "tres euros cincuenta"),
        ("Sra. Ruiz", "señora ruiz"),
        ("10:30", "diez y treinta"),
        ("1 km", "un kilómetro"),
        ("2024-05-02", "dos de mayo de dos mil veinticuatro"),
    ],
    "fr": [
        ('L’été, c’est ça !', "l'été c'est ça"),
        ('« Bonjour »', 'bonjour'),
        ('10 000 €', 'dix mille euros'),
        ('3,50 €', 'trois euros cinquante'),
        ('80 %', 'quatre vingts pour cent'),
        ('Rendez-vous à 10:30', 'rendez vous à dix heures trente'),
        ('M. et Mme Roux', 'monsieur et madame roux'),
        ('le 1er mai', 'le premier mai'),
        ('0,5 km', 'zéro virgule cinq kilomètres'),
        ('2024-07-14', 'quatorze juillet deux mille vingt quatre'),
    ],
    "it": [
        ('Perché no?', 'perché no'),
        ('l’amico', "l'amico"),
        ('21', 'ventuno'),
        ('1.000', 'mille'),
        ('3,5 kg', 'tre virgola cinque chili'),
        ('1 €', 'un euro'),
        ('10:30', 'dieci e trenta'),
        ('Dott.ssa Bianchi', 'dottoressa bianchi'),
        ('il 3º posto', 'il terzo posto'),
        ('50%', 'cinquanta per cento'),
    ],
    "pt": [
        ('Olá, não é?', 'olá não é'),
        ('21', 'vinte e um'),
        ('R$ 10', 'dez reais'),
        ('1 km', 'um quilómetro'),
        ('10:00', 'dez horas'),
        ('Sr. Silva', 'senhor silva'),
        ('o 2º andar', 'o segundo andar'),
        ('2024-04-25', 'vinte e cinco de abril de dois mil e vinte e quatro'),
        ('3,5', 'três vírgula cinco'),
        ('25 %', 'vinte e cinco por cento'),
    ],
    "nl": [
        ('’s Avonds', 's avonds'),
        ('ideeën', 'ideeën'),
        ('21', 'eenentwintig'),
        ('€ 5', 'vijf euro'),
        ('1 km', 'een kilometer'),
        ('10:30 uur', 'tien uur dertig'),
        ('d.w.z. nu', 'dat wil zeggen nu'),
        ('de 3e keer', 'de derde keer'),
        ('3,5', 'drie komma vijf'),
        ('20 °C', 'twintig graden celsius'),
    ],
    "sv": [
        ('Hej då!', 'hej då'),
        ('21', 'tjugoett'),
        ('10 000', 'tiotusen'),
        ('1 kr', 'en krona'),
        ('5 kr', 'fem kronor'),
        ('t. ex. nu', 'till exempel nu'),
        ('t.ex. nu', 'till exempel nu'),
        ('1:a gången', 'första gången'),
        ('10:05', 'tio noll fem'),
        ('1984', 'ettusen niohundraåttiofyra'),
        ('3,5', 'tre komma fem'),
    ],
    "pl": [
        ('Cześć, świecie!', 'cześć świecie'),
        ('21', 'dwadzieścia jeden'),
        ('1 zł', 'jeden złoty'),
        ('2 zł', 'dwa złote'),
        ('5 zł', 'pięć złotych'),
        ('22 km', 'dwadzieścia dwa kilometry'),
        ('10:30', 'dziesięć trzydzieści'),
        ('np. dziś', 'na przykład dziś'),
        ('3,5', 'trzy przecinek pięć'),
        ('50%', 'pięćdziesiąt procent'),
    ],
    "cs": [
        ('Příliš žluťoučký kůň', 'příliš žluťoučký kůň'),
        ('21', 'dvacet jedna'),
        ('1 Kč', 'jeden koruna'),
        ('3 Kč', 'tři koruny'),
        ('5 Kč', 'pět korun'),
        ('10:05', 'deset nula pět'),
        ('např. dnes', 'například dnes'),
        ('3,5', 'tři celá pět'),
        ('2024-05-08', 'osmého května dva tisíce dvacet čtyři'),
        ('10 000', 'deset tisíc'),
    ],
    "ru": [
        ('Привет, мир!', 'привет мир'),
        ('ёлка', 'ёлка'),
        ('21', 'двадцать один'),
        ('1 км', 'один километр'),
        ('3 км', 'три километра'),
        ('11 км', 'одиннадцать километров'),
        ('5 руб.', 'пять рублей'),
        ('10:30', 'десять тридцать'),
        ('и т. д.', 'и так далее'),
        ('3-й этаж', 'третий этаж'),
        ('3,5', 'три запятая пять'),
    ],
    "uk": [
        ('Привіт, світе!', 'привіт світе'),
        ('п’ять', "п'ять"),
        ('21', 'двадцять один'),
        ('2 ₴', 'два гривні'),
        ('5 км', "п'ять кілометрів"),
        ('10:30', 'десять тридцять'),
        ('і т. д.', 'і так далі'),
        ('3,5', "три кома п'ять"),
        ('ґудзик', 'ґудзик'),
        ('50 %', "п'ятдесят відсотків"),
    ],
    "tr": [
        ('Merhaba, dünya!', 'merhaba dünya'),
        ('ISPARTA İzmir', 'ısparta izmir'),
        ('12', 'oniki'),
        ('5 TL', 'beş lira'),
        ('%50', 'yüzde elli'),
        ('50 %', 'yüzde elli'),
        ('10:30', 'on otuz'),
        ('Ankara’da', "ankara'da"),
        ('3,5 km', 'üç virgül beş kilometre'),
        ('Dr. Kaya', 'doktor kaya'),
    ],
    "el": [
        ('Γειά σου, Κόσμε!', 'γειά σου κόσμε'),
        ('ΟΔΟΣ', 'οδος'),
        ('21', 'είκοσι ένα'),
        ('105', 'εκατόν πέντε'),
        ('1.984', 'χίλια εννιακόσια ογδόντα τέσσερα'),
        ('3.000.000', 'τρία εκατομμύρια'),
        ('5 €', 'πέντε ευρώ'),
        ('1 km', 'ένα χιλιόμετρο'),
        ('10:30', 'δέκα και τριάντα'),
        ('π.χ. εδώ', 'παραδείγματος χάριν εδώ'),
        ('π.Χ.', 'προ χριστού'),
        ('50%', 'πενήντα τοις εκατό'),
    ],
    "ko": [
        ('안녕하세요, 세계!', '안녕하세요 세계'),
        ('한글', '한글'),
        ('21', '이십일'),
        ('10:30', '열시 삼십분'),
        ('5 km', '오 킬로미터'),
        ('50%', '오십 퍼센트'),
        ('3.5', '삼 점 오'),
        ('2024-10-09', '이천이십사년 시월 구일'),
        ('₩1,000', '천 원'),
    ],
    "ar": [
        ('مرحبا، كيف الحال؟', 'مرحبا كيف الحال'),
        ('مَرْحَبًا', 'مَرْحَبًا'),
        ('٢١', 'واحد وعشرون'),
        ('٣٫٥', 'ثلاثة فاصلة خمسة'),
        ('5 كم', 'خمسة كيلومترات'),
        ('50 كم', 'خمسون كيلومتر'),
        ('عـــربي', 'عربي'),
        ('10:30', 'العاشرة وثلاثون دقيقة'),
        ('50%', 'خمسون بالمئة'),
        ('د. سامي', 'دكتور سامي'),
    ],
    "hi": [
        ('नमस्ते, दुनिया!', 'नमस्ते दुनिया'),
        ('हिन्दी', 'हिन्दी'),
        ('२१', 'इक्कीस'),
        ('99', 'निन्यानवे'),
        ('1,50,000', 'एक लाख पचास हज़ार'),
        ('5 km', 'पाँच किलोमीटर'),
        ('₹5', 'पाँच रुपये'),
        ('₹1', 'एक रुपया'),
        ('10:00', 'दस बजे'),
        ('डॉ. सिंह', 'डॉक्टर सिंह'),
        ('50%', 'पचास प्रतिशत'),
    ],
}  # fmt: skip
# Signs and letters that change how a number is said.
DECORATED = [
    ("en", "$5", "five dollars"),
    ("en", "-5", "minus five"),
    ("en", "1st 2nd 3rd 21st", "first second third twenty first"),
    ("en", "½ cup", "one half cup"),
    ("de", "5 €", "fünf euro"),
    ("es", "-5", "menos cinco"),
]
CASES = [(tag, text, spoken) for tag, cases in REAL.items() for text, spoken in cases]


@pytest.mark.parametrize(("tag", "text", "spoken"), CASES)
def test_a_real_text_is_read_as_people_say_it(tag: str, text: str, spoken: str) -> None:
    assert words(text, tag) == spoken


@pytest.mark.parametrize(("tag", "text", "spoken"), DECORATED)
def test_signs_at_a_number_are_read_as_people_say_them(tag: str, text: str, spoken: str) -> None:
    assert words(text, tag) == spoken


HOSTILE = {
    "many digits and a half": "9" * 400 + ".5",
    "many thousands": "1" + ",000" * 2500 + " 1" + ".000" * 2500,
    "many decimals": "0." + "1" * 10_000,
    "10,000 characters": "word " * 2000,
    "10,000 letters": "a" * 10_000,
    "10,000 digits": "7" * 10_000,
    "10,000 apostrophes": "a'" * 5000,
    "10,000 accents": "e" + "\u0301" * 10_000,
    "10,000 open tags": "<[" * 5000,
    "10,000 numbers apart": "1.2," * 2500,
    "right to left": "שלום עולם ‏مرحبا‎ 123 ٣٫٥ ۱۲",
    "control characters": "".join(map(chr, range(32))) + "\x7f\x80\x9f",
    "half an emoji": "a\ud83db",
    "superscripts and circles": "m² ① Ⅷ ½ ㍿ ﬁ",
    "digits of other scripts": "१२३ ௧௨ 𝟙𝟚 ๑,๒ ²³",
    "upper case that grows": "İSTANBUL ŞİŞLİ ẞ ǅ",
}


@pytest.mark.parametrize("tag", LANGUAGES)
@pytest.mark.parametrize("case", HOSTILE)
def test_no_text_raises(case: str, tag: str) -> None:
    require_sound(HOSTILE[case], tag)


CHARACTERS = st.one_of(
    st.characters(exclude_categories=("Cs",)),
    st.sampled_from("019.,'’-<>[]%$ \u0301\u00ad½²٣éÉaZß"),
)


@given(st.text(CHARACTERS, max_size=30), st.sampled_from(LANGUAGES))
@settings(deadline=None, derandomize=True, max_examples=300)
def test_any_text_gives_words_that_point_at_their_source(text: str, tag: str) -> None:
    require_sound(text, tag)


@given(
    st.from_regex(r"[0-9]{1,15}([.,][0-9]{1,4}){0,3}", fullmatch=True), st.sampled_from(LANGUAGES)
)
@settings(deadline=None, derandomize=True, max_examples=150)
def test_any_number_is_read_as_words_without_digits(text: str, tag: str) -> None:
    require_sound(text, tag)
    found = tokens(text, language(tag))
    assert found
    assert {(token.start, token.end) for token in found} == {(0, len(text))}
    assert not any(c.isdigit() for token in found for c in token.text)


def require_sound(text: str, tag: str) -> None:
    """Words are lower case without separators, in order, each from a part that is not blank."""
    cursor = (0, 0)
    for token in tokens(text, language(tag)):
        assert token.text
        assert token.text == token.text.lower()
        assert not set(token.text) & set(" \t\n,.-<>[]")
        assert 0 <= token.start < token.end <= len(text)
        piece = text[token.start : token.end]
        assert piece == piece.strip()
        span = (token.start, token.end)
        assert span == cursor or token.start >= cursor[1]
        cursor = span
        if piece[0].isalpha() and piece.isascii() and not (tag == "tr" and "I" in piece):
            assert piece.lower() == token.text


@given(
    st.lists(st.sampled_from(("one", "Zoë", "don’t", "x")), max_size=6),
    st.sampled_from((" ", "\n", ", ", " — ", "… ", " [tag] ", " <t/>", " 😀 ")),
)
@settings(deadline=None, derandomize=True, max_examples=100)
def test_separators_of_any_kind_leave_the_words_alone(spoken: list[str], between: str) -> None:
    text = between.join(spoken)
    found = tokens(text, language("en"))
    assert [token.text for token in found] == [w.lower().replace("’", "'") for w in spoken]
    assert [text[token.start : token.end] for token in found] == spoken


@pytest.mark.parametrize("text", ["cafe\u0301 noir", "e\u0301e\u0301 b", "\u212b b"])
def test_positions_are_those_of_the_transcript_itself(text: str) -> None:
    last = tokens(text, language("en"))[-1]
    assert text[last.start : last.end] == text.split()[-1]


@pytest.mark.parametrize("tag", ["en", "en-GB", "EN_us", "de-AT", "es-419"])
def test_region_and_case_of_a_tag_do_not_matter(tag: str) -> None:
    assert language(tag) == language(tag[:2].lower())


def test_decomposed_hangul_is_one_word() -> None:
    text = unicodedata.normalize("NFD", "한글 좋다")
    assert words(text, "ko") == "한글 좋다"
